"""Files that are replaced whole: whether one can be written, and a temporary name that becomes it when all went well."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

from ..errors import InputError
from .together import FOREVER, PATIENCE, all_come, on_all_ranks


def not_writable(path: Path) -> str:
    """Why a file cannot be written there; empty if it can."""
    folder = path.parent
    try:
        if path.is_dir():
            return "is a folder"
        if path.exists() and not path.is_file():
            return "is no ordinary file"  # opening a pipe would block, and a device would be replaced
        if not folder.is_dir():
            return f"folder {folder} does not exist"
        with tempfile.TemporaryFile(dir=folder):  # by trying: permission bits say little about root and network disks
            pass
        if path.exists():
            with path.open("ab"):
                pass
        with suppress(FileNotFoundError):  # a name as `replacing` makes it; Path.exists() hides errors
            os.stat(path.with_name(f".{path.stem}.0000000{path.suffix.lower()}"))
    except OSError as error:
        return f"cannot be written in {folder}: {error.strerror}"
    except ValueError as error:  # a name that no file can have
        return str(error)
    return ""


@contextmanager
def replacing(path: Path, comm: MPI.Comm) -> Iterator[str]:
    """A temporary name beside `path`, which becomes `path` when the block ends well, and vanishes when not. Collective.

    Raises
    ------
    InputError : a rank could not write, rank 0 could not rename; on every rank, but for those that still wait inside HDF5 for
        one that failed there.
    """
    temporary = Path(comm.bcast(str(path.with_name(f".{path.stem}.{os.getpid()}{path.suffix.lower()}"))))
    reason, failed = "", None
    try:
        with on_all_ranks(comm, f"{path}: could not be written"):  # PETSc's viewers would fail on rank 0 alone
            if comm.rank == 0:
                temporary.touch()
        try:
            yield str(temporary)
        except OSError as error:
            reason = error.strerror or str(error)
        except PETSc.Error as error:
            reason = f"PETSc's error code {error.ierr}; is the disk full?"
            failed = error
        if not all_come(comm, PATIENCE if failed else FOREVER):
            raise InputError(f"{path}: could not be written: {reason}") from failed
        with on_all_ranks(comm, f"{path}: could not be written"):
            if reason:
                raise InputError(reason)
        with on_all_ranks(comm, f"{path}: could not be written"):
            if comm.rank == 0:
                os.replace(temporary, path)
    except BaseException:  # an interrupt may fall anywhere
        with suppress(OSError):  # why it could not be made is told
            temporary.unlink()
        raise


def write_text(path: Path, text: str, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
    """Write a file of text, rank 0's. Collective; raises as `replacing` does."""
    with replacing(path, comm) as temporary:
        if comm.rank == 0:
            Path(temporary).write_text(text, encoding="utf-8")
