"""Commands that tests fork from a standing process are as new ones: words, status, signals, environment, no state shared."""

import marshal
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ENVIRONMENT, TESTS, Run, gone, python, start

STATE = """
import os, random, sys
early = "lcp_lube.api" in sys.modules
import mpi4py, petsc4py
assert not hasattr(mpi4py, "MPI") and not hasattr(petsc4py, "PETSc")
from lcp_lube.base.petsc import start
start(sys.argv[1:])
from mpi4py import MPI
from petsc4py import PETSc
import numpy as np
print(early, sorted(PETSc.Options().getAll()), MPI.COMM_WORLD.size, MPI.Query_thread() == MPI.THREAD_FUNNELED)
print(np.random.rand(), random.random())
"""
needs_forks = pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="this system has no pidfd_open: all processes are new")


def both(words: list[str], folder: Path, **more: str) -> list[Run]:
    """Forked and new."""
    ends = [
        subprocess.run([*how, *words], cwd=folder, env=ENVIRONMENT | more, capture_output=True, text=True, timeout=60)
        for how in (python(), [sys.executable])
    ]
    return [Run(end.returncode, end.stdout, end.stderr) for end in ends]


@pytest.mark.parametrize(
    "words",
    [
        "solve problem1 --method din --monitor",
        "solve problem1 --set h_min=10um -ksp_view ::ascii_info",
        "solve problem1 --n 20 --method din --max-it 1",
        "solve problem9",
        "solve problem1 -ksp_typ gmres",
        "list",
        "--version",
        "solve --help",
        "-help",
    ],
)
def test_a_forked_command_says_what_a_new_one_says(tmp_path: Path, words: str) -> None:
    forked, new = both(["-m", "lcp_lube", *words.split()], tmp_path)
    times = re.compile(r"\d+(\.\d+)?(e[+-]\d+)? s\b|pid \d+")
    assert forked.status == new.status
    assert times.sub("", forked.out) == times.sub("", new.out) and times.sub("", forked.err) == times.sub("", new.err)


@needs_forks
@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks_are_forked_too(tmp_path: Path, ranks: int) -> None:
    """mpiexec hands on an environment for which that is right."""
    words = ["-c", "import sys; print('lcp_lube.api' in sys.modules)"]
    assert start(words, ranks, tmp_path, timeout=60).out.count("True") == ranks


@needs_forks
def test_who_asks_may_be_killed(tmp_path: Path) -> None:
    """Before a word, and before the answer, as mpiexec ends ranks: the standing process goes on."""
    for said in (False, True):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as asks, open(os.devnull, "r+b") as null:
            asks.connect(python()[-1])
            if said:
                words = ["-c", "import time; time.sleep(0.1)"], str(tmp_path), dict(ENVIRONMENT)
                socket.send_fds(asks, [marshal.dumps(words)], 3 * [null.fileno()])
    assert start(["-c", "print(1)"], 1, tmp_path, timeout=60).out == "1\n"


def test_an_exception_is_a_traceback_and_status_1(tmp_path: Path) -> None:
    (tmp_path / "fails.py").write_text("import atexit\natexit.register(print, 'end')\nprint('begin', __name__)\n1 / 0\n")
    for end in both([str(tmp_path / "fails.py")], tmp_path):
        assert (end.status, end.out) == (1, "begin __main__\nend\n")
        assert end.err.startswith("Traceback") and end.err.endswith("ZeroDivisionError: division by zero\n")


ENDS = """
import atexit, ctypes, sys, threading, time
atexit.register(print, "atexit")
threading.Thread(target=lambda: (time.sleep(0.1), print("thread"))).start()
print("begin")
sys.stdout.flush()
ctypes.CDLL(None).puts(b"of C's streams")
"""


@needs_forks
@pytest.mark.parametrize(
    "end", ["", "sys.exit()", "sys.exit(3)", "sys.exit(-1)", "sys.exit(300)", "sys.exit('why')", "raise KeyboardInterrupt"]
)
def test_an_end_is_that_of_a_new_process(tmp_path: Path, end: str) -> None:
    """Threads are waited for, what is registered for the end is called, all streams are written."""
    (tmp_path / "ends.py").write_text(ENDS + end)
    forked, new = both([str(tmp_path / "ends.py")], tmp_path)
    assert forked.status == new.status and forked.err.splitlines()[-1:] == new.err.splitlines()[-1:]
    assert sorted(forked.out.splitlines()) == sorted(new.out.splitlines()) == ["atexit", "begin", "of C's streams", "thread"]


@needs_forks
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_output_that_cannot_be_written_is_an_error_at_the_end(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        ends = [
            subprocess.run([*how, "-c", "print(1)"], env=ENVIRONMENT, stdout=full, stderr=subprocess.PIPE, text=True)
            for how in (python(), [sys.executable])
        ]
    forked, new = ends
    assert forked.returncode == new.returncode != 0 and all("No space left" in end.stderr for end in ends)


@needs_forks
def test_nothing_is_shared_but_imports(tmp_path: Path) -> None:
    """MPI and PETSc start in the child, with its options; random numbers are its own."""
    (tmp_path / "state.py").write_text(STATE)
    script = str(tmp_path / "state.py")
    first, new = both([script, "-my_option", "3"], tmp_path)
    second, _ = both([script], tmp_path)
    told = [run.out.splitlines() for run in (first, second, new)]
    assert [lines[0] for lines in told] == [
        "True ['my_option'] 1 True",
        "True [] 1 True",
        "False ['my_option'] 1 True",
    ], [run.err for run in (first, second, new)]
    assert len({number for lines in told for number in lines[1].split()}) == 6


@needs_forks
@pytest.mark.parametrize(
    "name", ["OMP_NUM_THREADS", "OPENBLAS_CORETYPE", "PETSC_OPTIONS", "NUMBA_DISABLE_JIT", "PYTHONWARNINGS"]
)
def test_another_environment_is_a_new_process(tmp_path: Path, name: str) -> None:
    (tmp_path / "seen.py").write_text(f"import os, sys; print('lcp_lube' in sys.modules, os.environ[{name!r}])")
    kernel = "Prescott" if os.environ.get("OPENBLAS_CORETYPE") != "Prescott" else "Haswell"
    value = {"OMP_NUM_THREADS": "3", "OPENBLAS_CORETYPE": kernel, "PETSC_OPTIONS": "-a 1", "PYTHONWARNINGS": "error"}
    for end in both([str(tmp_path / "seen.py")], tmp_path, **{name: value.get(name, "1")}):
        assert end.out == f"False {value.get(name, '1')}\n", end.err


@needs_forks
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_signals_arrive(tmp_path: Path, number: int) -> None:
    """The child ends by them, also by the one that nothing can pass on, and the command as it did."""
    (tmp_path / "waits.py").write_text("import os, time\nprint(os.getpid(), flush=True)\ntime.sleep(60)")
    pipe = subprocess.PIPE
    command = [*python(), str(tmp_path / "waits.py")]
    job = subprocess.Popen(command, env=ENVIRONMENT, stdout=pipe, stderr=pipe, text=True)
    assert job.stdout is not None
    child = int(job.stdout.readline())
    begin = time.monotonic()
    job.send_signal(number)
    job.communicate(timeout=30)
    assert job.returncode == -number and gone([child], 10) and time.monotonic() - begin < 30


@needs_forks
def test_a_child_that_a_signal_ends_is_told_as_one(tmp_path: Path) -> None:
    (tmp_path / "dies.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)")
    assert [end.status for end in both([str(tmp_path / "dies.py")], tmp_path)] == [-signal.SIGSEGV] * 2


@needs_forks
def test_children_end_with_the_standing_process(tmp_path: Path) -> None:
    path = str(tmp_path / "socket")
    pipe = subprocess.PIPE
    words = [sys.executable, str(TESTS / "standing.py"), "--serve", path]
    server = subprocess.Popen(words, env=ENVIRONMENT, stdin=pipe, stdout=pipe, text=True)
    assert server.stdin is not None and server.stdout is not None and server.stdout.readline() == "ready\n"
    (tmp_path / "waits.py").write_text("import os, time\nprint(os.getpid(), flush=True)\ntime.sleep(60)")
    command = [*python()[:-1], path, str(tmp_path / "waits.py")]
    job = subprocess.Popen(command, env=ENVIRONMENT, stdout=pipe, text=True)
    assert job.stdout is not None
    child = int(job.stdout.readline())
    server.communicate(timeout=10)
    job.communicate(timeout=10)
    assert server.returncode == 0 and job.returncode == 1 and gone([child], 10) and not Path(path).exists()
