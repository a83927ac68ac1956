"""Starting PETSc so that what it would crash on is one line: arguments checked before, its messages caught at the start."""

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, nearest

LOGICAL = {"", "true", "false", "yes", "no", "on", "off", "1", "0"}
# Read when PETSc ends, after our exit status is decided: their values are checked before it starts.
LATE_FLAGS = {"options_left", "options_view", "malloc_dump"}
PLAIN_FILES = {"history", "log_trace", "malloc_view", "log_summary"}
LOG_FORMATS = ("default", "ascii_info", "ascii_info_detail", "ascii_csv", "ascii_xml", "ascii_flamegraph")

# What the launchers of MPI's processes put into their environment.
LAUNCHED = ("OMPI_COMM_WORLD_", "PMI_", "PMIX_", "MV2_COMM_", "PALS_", "ALPS_APP_", "SLURM_PROCID")
# For Open MPI, where a process is alone: no daemon for others to come, no search for networks. That takes longer than a solve.
ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1"}


def start(arguments: list[str]) -> None:
    """Initialise MPI and PETSc with these arguments.

    More than one OpenMP thread a rank is only on request: ranks are the parallelism, and SuperLU_DIST 8.1.2 gives wrong
    factors with threads.

    Raises
    ------
    InputError : PETSc refuses the arguments, in its own words; or it is not there.
    """
    check(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        import mpi4py

        mpi4py.rc.thread_level = "funneled"  # as PETSc would start it
        import petsc4py

        with _alone():
            from mpi4py import MPI  # noqa: F401  (starts MPI: what it says if it cannot is not caught below)
    except ImportError as error:
        raise InputError(f"PETSc for Python is needed, see docs/install.md: {error}") from None
    sys.stderr.flush()
    before = os.dup(2)
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            petsc4py.init(["lcp-lube", *arguments])
            refused = None
        except Exception as error:
            refused = error
        finally:
            os.dup2(before, 2)
            os.close(before)
            said.seek(0)
            text = said.read().decode(errors="replace")
    if refused is None:
        sys.stderr.write(text)  # warnings of MPI, say
        return
    # The line after the box's title is PETSc's class of error, the one after that says what it is.
    lines = [line.partition("PETSC ERROR: ")[2] for line in text.splitlines() if "PETSC ERROR: " in line]
    reason = lines[2] if len(lines) > 2 else (text.strip().splitlines() or [str(refused)])[-1]
    value = next((word for word in arguments if not word.startswith("-") and word in reason), None)
    culprit = f"{arguments[arguments.index(value) - 1]} {value}: " if value else ""
    raise InputError(f"{culprit}PETSc does not start: {reason}") from None


def launched() -> bool:
    """Whether a launcher of MPI jobs has started this process: mpiexec, srun."""
    return any(name.startswith(LAUNCHED) for name in os.environ)


@contextmanager
def _alone() -> Iterator[None]:
    """While MPI starts in a process that no launcher started: settings for one process, but for those that the user has made.

    They go afterwards: a job that this process starts is not to inherit them.
    """
    if launched():
        yield
        return
    added = [name for name in ALONE if name not in os.environ]
    os.environ.update((name, ALONE[name]) for name in added)
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]


def forget_unread() -> None:
    """Newer releases of PETSc warn at their end of options that nobody read; what there is to say has been said in a line."""
    if "petsc4py.PETSc" in sys.modules:
        from petsc4py import PETSc

        from .options import unread

        for name in unread() if PETSc.Sys.isInitialized() else ():
            PETSc.Options().delValue(name)


def check(arguments: list[str]) -> None:
    """Raise InputError for values that would end PETSc in a crash at its start or, as -log_view's, at its very end."""
    for k, word in enumerate(arguments):
        if not _is_option(word):
            continue
        name, after = word.lstrip("-"), arguments[k + 1 : k + 2]
        value = after[0] if after and not _is_option(after[0]) else ""
        if name in LATE_FLAGS and value.lower() not in LOGICAL:
            raise InputError(f"{word} {value}: allowed are true and false")
        if name in PLAIN_FILES and value:
            _check_folder(word, value, value)
        if re.search(r"view|monitor|^info$", name):
            for view in value.split(","):
                kind, _, rest = view.partition(":")
                file, _, form = rest.partition(":")
                if name == "log_view":
                    _check_log_view(word, value, kind, form.partition(":")[0])
                if file:
                    _check_folder(word, value, file)


def _is_option(word: str) -> bool:
    return re.match(r"-[A-Za-z]", word) is not None


def _check_log_view(word: str, value: str, kind: str, form: str) -> None:
    if kind not in ("", "ascii"):
        raise InputError(f"{word} {value}: nothing, or :FILE[:FORMAT], is allowed")
    if form and form not in LOG_FORMATS:
        raise InputError(f"{word} {value}: format {form}: allowed are {', '.join(LOG_FORMATS)}{nearest(form, LOG_FORMATS)}")


def _check_folder(word: str, value: str, file: str) -> None:
    folder = Path(file).parent
    if not folder.is_dir():
        raise InputError(f"{word} {value}: folder {folder} does not exist")
    if Path(file).is_dir() or not os.access(Path(file) if Path(file).exists() else folder, os.W_OK):
        raise InputError(f"{word} {value}: cannot be written")
