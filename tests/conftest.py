"""Fixtures of all tests: clean PETSc options, the command line, jobs under mpiexec."""

import atexit
import fcntl
import gc
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

TESTS = Path(__file__).parent
# Open MPI's own files: one process of tests ends its jobs, and removes the folder that is empty then, while another starts one.
JOBS = tempfile.mkdtemp(prefix="mpi-")
atexit.register(shutil.rmtree, JOBS, ignore_errors=True)
# A singleton's MPI leaves traces in the environment that would confuse a job started from it.
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX_", "PMI_", "PETSC_OPTIONS"))} | {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    # On cores that others use too: ranks that wait give way, and move.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    # A job whose ranks end with a status of ours: the ranks have ended already, mpiexec need not wait a second for them.
    "OMPI_MCA_odls_base_sigkill_timeout": "0",
    "OMPI_MCA_orte_tmpdir_base": JOBS,
    "PYTHONPATH": os.pathsep.join(filter(None, [str(TESTS.parent), os.environ.get("PYTHONPATH", "")])),
}
os.environ.setdefault("OMP_NUM_THREADS", "1")
# A shell starts background jobs with SIGINT ignored, and a process that tests start would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples in every run; HYPOTHESIS_PROFILE=default looks for new ones.
settings.register_profile("fixed", derandomize=True, deadline=None, database=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))


def pytest_collection_finish() -> None:
    """Thousands of tests wait in memory: the garbage collector, which tests call hundreds of times, passes over them."""
    gc.collect()
    gc.freeze()


@dataclass(frozen=True)
class Run:
    """How a process ended and what it said."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """The whole of stdout as one JSON value."""
        return json.loads(self.out)

    @property
    def lines(self) -> list[str]:
        """Lines on stderr, but for what mpiexec adds to a rank's exit status."""
        return without_notices(self.err)


NOTICE = re.compile(r"\[\S+:\d+\]|\[warn\] Epoll ")


def without_notices(text: str) -> list[str]:
    """Lines that are not mpiexec's: neither in its boxes, which may come before or after ours, nor in its log, nor libevent's
    warnings of a rank's pipe that is gone."""
    lines, boxed = [], False
    for line in text.splitlines():
        if line.startswith("-" * 70):
            boxed = not boxed
        elif line.strip() and (not boxed or line.startswith("lcp-lube: ")) and not NOTICE.match(line):
            lines.append(line)
    return lines


@cache
def python() -> list[str]:
    """How a test begins a command: forked from a standing process, one for each process of tests (see standing.py).

    `sys.executable` instead where the start itself is what is tested.
    """
    if not hasattr(os, "pidfd_open"):
        return [sys.executable]
    path = str(Path(tempfile.mkdtemp(prefix="lcp-lube-")) / "socket")
    pipe = subprocess.PIPE
    server = subprocess.Popen(
        [sys.executable, str(TESTS / "standing.py"), "--serve", path], env=ENVIRONMENT, stdin=pipe, stdout=pipe, text=True
    )
    assert server.stdin is not None and server.stdout is not None
    atexit.register(server.communicate)
    assert server.stdout.readline() == "ready\n"
    if "PYTEST_XDIST_WORKER" in os.environ:
        # From here on ranks, which the standing process forks, go before tests. A rank that waits for another yields its core
        # again and again, and a test beside it would keep it for some ms each time: a job of 2 s took half a minute.
        os.nice(19)
    return [sys.executable, "-I", "-S", str(TESTS / "standing.py"), path]


def job(arguments: list[str], ranks: int, new: bool = False) -> list[str]:
    """The command of a Python process, or of an MPI job of several; new : that share nothing with a standing process."""
    command = [*([sys.executable] if new else python()), *arguments]
    if ranks == 1:
        return command
    if shutil.which("mpiexec") is None:
        pytest.skip("no mpiexec")
    # By its name: called by its path it sets LD_LIBRARY_PATH, an environment for which the standing process does not fork.
    return ["mpiexec", "-n", str(ranks), *command]


def start(arguments: list[str], ranks: int, cwd: Path, timeout: float, new: bool = False) -> Run:
    """A Python process, or an MPI job of several, with a time limit."""
    done = subprocess.run(job(arguments, ranks, new), cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True, timeout=timeout)
    return Run(done.returncode, done.stdout, done.stderr)


def alive(pid: int) -> bool:
    """Whether a process runs; a zombie, which its parent has not asked about yet, does not."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def gone(pids: list[int], seconds: float) -> bool:
    """Whether none of these processes runs, after some seconds at most."""
    end = time.monotonic() + seconds
    while any(map(alive, pids)) and time.monotonic() < end:
        time.sleep(0.05)
    return not any(map(alive, pids))


@pytest.fixture
def cli(tmp_path: Path) -> Callable[..., Run]:
    """`cli("solve", "problem1", ranks=2)`: the command line as a process, in a folder of its own."""

    def run(*words: object, ranks: int = 1, timeout: float = 60, new: bool = False) -> Run:
        return start(["-m", "lcp_lube", *map(str, words)], ranks, tmp_path, timeout, new)

    return run


@pytest.fixture
def script(tmp_path: Path) -> Callable[..., Run]:
    """`script("mpi_fields.py", ranks=3)`: a script of this folder as an MPI job."""

    def run(name: str, *words: object, ranks: int = 1, timeout: float = 120) -> Run:
        return start([str(TESTS / name), *map(str, words)], ranks, tmp_path, timeout)

    return run


@pytest.fixture(autouse=True)
def clean_options() -> Iterator[None]:
    """Every test begins without PETSc options and leaves none behind."""
    yield
    if "petsc4py.PETSc" not in sys.modules:
        return
    from petsc4py import PETSc

    options = PETSc.Options()
    left = options.getAll()
    for name in left:
        options.delValue(name)
    assert not left, f"the test left PETSc options behind: {left}"


@pytest.fixture(autouse=True)
def hypre(request: pytest.FixtureRequest) -> None:
    """`@pytest.mark.hypre`: skipped where PETSc was built without it."""
    if request.node.get_closest_marker("hypre"):
        from petsc4py import PETSc

        if not PETSc.Sys.hasExternalPackage("hypre"):
            pytest.skip("this PETSc has no hypre")


@pytest.fixture
def petsc_options() -> Iterator[Callable[..., None]]:
    """`petsc_options(ksp_type="gmres")` sets PETSc options for one test, as the command line would."""
    from petsc4py import PETSc

    options, names = PETSc.Options(), []

    def set_options(**given: object) -> None:
        for name, value in given.items():
            options.setValue(name, str(value) if value is not None else None)
            names.append(name)

    yield set_options
    for name in names:
        options.delValue(name)


@pytest.fixture(scope="session")
def mpi_job(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], dict[str, Any]]:
    """`mpi_job(3)`: the record and, under "fields", the whole fields of tests/mpi_job.py; run once for a number of ranks.

    Whichever process of tests asks first runs it for all.
    """
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    @cache
    def run(ranks: int) -> dict[str, Any]:
        folder = shared / f"ranks{ranks}"
        folder.mkdir(exist_ok=True)
        with open(folder / "lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (folder / "record.json").exists():
                end = start([str(TESTS / "mpi_job.py"), str(folder)], ranks, folder, timeout=400)
                assert end.status == 0, end.err
        with np.load(folder / "fields.npz") as fields:
            return {**json.loads((folder / "record.json").read_text()), "fields": dict(fields)}

    return run


@pytest.fixture
def carried(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, bool]]:
    """Of each call of the energy equation's solver: its inner steps, and whether it went up the flow."""
    from lcp_lube.problems.film.transport import Transport

    calls, carry = list[tuple[int, bool]](), Transport.__call__

    def noted(self: Any, heat: Any, transposed: bool = False) -> Any:
        found = carry(self, heat, transposed)
        calls.append((self.ksp.getIterationNumber(), transposed))
        return found

    monkeypatch.setattr(Transport, "__call__", noted)
    return calls
