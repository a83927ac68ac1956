"""What fails on one rank is told on all of them, without a hang and without an abort."""

import shutil
import subprocess
import sys

import pytest
from conftest import ENVIRONMENT, TESTS


@pytest.mark.parametrize(
    "case, reason, ranks",
    [
        ("helper", "here: bad on purpose", 3),
        ("F", "F(x): ZeroDivisionError: on purpose", 2),
        ("F", "F(x): ZeroDivisionError: on purpose", 3),
        ("J", "J(x): ZeroDivisionError: on purpose", 3),
        ("file", "no/such/folder/x.npz: could not be written: No such file or directory", 2),
        ("table", "/proc/no/x.csv: No such file or directory", 2),
        ("picture", "x.png: no figure", 2),
        ("vts", "x.vts: could not be written: cut short; is the disk full?", 2),
        ("npz", "x.npz: could not be written: File too large", 2),
        ("h5", "x.h5: could not be written: File too large", 2),
        ("h5 elsewhere", "x.h5: could not be written: No such file or directory", 2),
        ("write", "MPI_ERR_NO_SUCH_FILE", 2),
        ("read", "MPI_ERR_NO_SUCH_FILE", 2),
        ("doctor", "ZeroDivisionError: on purpose", 2),
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
