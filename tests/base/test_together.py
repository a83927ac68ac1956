"""What fails on one rank is told on all of them, without a hang and without an abort."""

import pytest
from conftest import TESTS, start


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
        ("read", "--resume y.ckpt: MPI_ERR_NO_SUCH_FILE", 2),
        ("doctor", "ZeroDivisionError: on purpose", 2),
    ],
)
def test_every_rank_is_told(tmp_path, case, reason, ranks):
    done = start([str(TESTS / "mpi_together.py"), case], ranks, tmp_path, timeout=120)
    assert done.status == 2 and done.out == "" and "Traceback" not in done.err
    assert done.err.count(f"told {reason}") == done.err.count("told ") == ranks
    assert list(tmp_path.iterdir()) == []
