"""Faults of one rank: the job ends soon, with one message, and leaves no process behind."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from conftest import ENVIRONMENT, TESTS, gone, without_notices

WORDS = "solve problem1 --n 30 --method din --system full --recipe mumps".split()  # noqa: SIM905
RANKS = 3
PIDS = re.compile(r"pid (\d+)")
# What a user's mpiexec does.
PLAIN = {name: value for name, value in ENVIRONMENT.items() if name != "OMPI_MCA_odls_base_sigkill_timeout"}


def limit():
    """10 s on a machine that is free."""
    return 10.0 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


class Job:
    """A job of tests/mpi_one_rank_fails.py, watched until every rank has come to its first linear solve."""

    def __init__(self, failure, folder):
        script = [sys.executable, str(TESTS / "mpi_one_rank_fails.py"), failure, *WORDS]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            ["mpiexec", "-n", str(RANKS), *script], cwd=folder, env=PLAIN, stdout=pipe, stderr=pipe, text=True
        )
        self.said, self.pids = "", []
        for line in self.process.stderr:
            self.said += line
            self.pids += map(int, PIDS.findall(line))
            if len(self.pids) == RANKS:
                break
        self.since = time.monotonic()

    def end(self):
        """Status, what was said apart from process ids, and the seconds that the end took."""
        out, err = self.process.communicate(timeout=60)
        seconds = time.monotonic() - self.since
        assert out == ""
        lines = [line for line in without_notices(self.said + err) if not PIDS.match(line)]
        return self.process.returncode, lines, seconds


EXCEPTIONS = {
    "error": (1, "ZeroDivisionError: on purpose"),
    "input": (2, "lcp-lube: bad on purpose"),
    "memory": (2, "lcp-lube: not enough memory; fewer points or more ranks are needed"),
    "interrupt": (130, "lcp-lube: interrupted"),
}


def excepted(folder, failure):
    job = Job(failure, folder)
    return *job.end(), gone(job.pids, 2)


def rank_killed(folder, victim):
    job = Job("sleep", folder)
    os.kill(job.pids[victim], signal.SIGKILL)
    return *job.end(), gone(job.pids, 2)


def mpiexec_killed(folder):
    job = Job("sleep", folder)
    job.process.kill()
    left = gone(job.pids, limit())
    job.process.communicate(timeout=60)
    return left


def interrupted(folder):
    job = Job("sleep", folder)
    job.process.send_signal(signal.SIGINT)
    return *job.end(), gone(job.pids, 2)


def unequal(folder, programs, files):
    """One rank each with words and a folder of its own; status and our lines."""
    command = ["mpiexec"]
    for k, (words, file) in enumerate(zip(programs, files, strict=True)):
        own = folder / str(k)
        own.mkdir()
        if file:
            (own / "my.toml").write_text(file)
        command += [*([":"] if k else []), "-n", "1", "-wdir", str(own), sys.executable, "-m", "lcp_lube", *words.split()]
    done = subprocess.run(command, cwd=folder, env=PLAIN, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == "" and "Traceback" not in done.stderr
    return done.returncode, [line for line in done.stderr.splitlines() if line.startswith("lcp-lube: ")]


MINE = "family = 'slider'\nh_min = {}\nn = 30\n"
CASES: dict[str, tuple[Any, ...]] = {
    **{failure: (excepted, failure) for failure in EXCEPTIONS},
    "one lacks": (unequal, ["solve my.toml"] * 2, [MINE.format(1e-5), ""]),
    **{f"rank {victim}": (rank_killed, victim) for victim in range(RANKS)},
    "mpiexec": (mpiexec_killed,),
    "Control-C": (interrupted,),
    "words": (unequal, ["solve problem1 --n 30", "solve problem1 --n 31"], ["", ""]),
    "files": (unequal, ["solve my.toml"] * 2, [MINE.format(1e-5), MINE.format(2e-5)]),
}  # those that wait longest first


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """How each job ended: some at the same time, as most wait seconds for ranks that do not come."""
    if shutil.which("mpiexec") is None:
        pytest.skip("no mpiexec")
    folders = {name: tmp_path_factory.mktemp("job") for name in CASES}
    with ThreadPoolExecutor(6) as pool:
        jobs = {name: pool.submit(run, folders[name], *given) for name, (run, *given) in CASES.items()}
        yield lambda name: jobs[name].result()


@pytest.mark.parametrize("failure", EXCEPTIONS)
def test_an_exception_on_one_rank(ended, failure):
    status, lines, seconds, left = ended(failure)
    assert (status, lines[-1]) == EXCEPTIONS[failure]
    assert len(lines) == 1 or failure == "error"
    assert seconds < limit() and left


@pytest.mark.parametrize("victim", range(RANKS))
def test_a_killed_rank(ended, victim):
    """mpiexec hears of it and ends the others, which wait for it in a collective call."""
    status, lines, seconds, left = ended(f"rank {victim}")
    assert status != 0 and lines == [] and seconds < limit() and left


def test_a_killed_mpiexec_leaves_no_orphans(ended):
    assert ended("mpiexec")


def test_an_interrupted_mpiexec_leaves_no_orphans(ended):
    """Control-C."""
    status, _, seconds, left = ended("Control-C")
    assert status != 0 and seconds < limit() and left


@pytest.mark.parametrize(
    "case, message",
    [
        ("words", "command line: not the same on rank 0 and on rank 1"),
        ("files", "scene my or how to solve it: not the same on rank 0 and on rank 1"),
        ("one lacks", "my.toml: No such file or directory"),
    ],
)
def test_unequal_input(ended, case, message):
    assert ended(case) == (2, [f"lcp-lube: {message}"])
