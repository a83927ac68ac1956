"""What fails on one rank is told on all of them, without a hang and without an abort."""

import shutil
import subprocess
import sys

import pytest
from conftest import ENVIRONMENT, TESTS


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize(
    "case, reason",
    [
        ("helper", "here: bad on purpose"),
        ("F", "F(x): ZeroDivisionError: on purpose"),
        ("J", "J(x): ZeroDivisionError: on purpose"),
        ("file", "no/such/folder/x.npz: could not be written: No such file or directory"),
        ("table", "/proc/no/x.csv: No such file or directory"),
        ("picture", "x.png: no figure"),
    ],
)
def test_every_rank_is_told(tmp_path, case, reason, ranks):
    mpiexec = shutil.which("mpiexec")
    if mpiexec is None:
        pytest.skip("no mpiexec")
    command = [mpiexec, "-n", str(ranks), sys.executable, str(TESTS / "mpi_together.py"), case]
    done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2 and done.stdout == "" and "Traceback" not in done.stderr
    assert done.stderr.count(f"told {reason}") == done.stderr.count("told ") == ranks
    assert list(tmp_path.iterdir()) == []
