"""Faults of one rank: the job ends soon, with one message, and leaves no process behind."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from conftest import ENVIRONMENT, TESTS, gone, without_notices

WORDS = "solve problem1 --n 30 --method din --system full --recipe mumps".split()  # noqa: SIM905
RANKS = 3
PIDS = re.compile(r"pid (\d+)")


def limit():
    """10 s on a machine that is free."""
    return 10.0 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


class Job:
    """A job of tests/mpi_one_rank_fails.py, watched until every rank has come to its first linear solve."""

    def __init__(self, failure, folder):
        if shutil.which("mpiexec") is None:
            pytest.skip("no mpiexec")
        script = [sys.executable, str(TESTS / "mpi_one_rank_fails.py"), failure, *WORDS]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            ["mpiexec", "-n", str(RANKS), *script], cwd=folder, env=ENVIRONMENT, stdout=pipe, stderr=pipe, text=True
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


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """How a job of each exception ended: at the same time, as each waits some seconds for ranks that do not come."""

    folders = {failure: tmp_path_factory.mktemp(failure) for failure in EXCEPTIONS}

    def end(failure):
        job = Job(failure, folders[failure])
        return *job.end(), gone(job.pids, 2)

    with ThreadPoolExecutor(len(EXCEPTIONS)) as pool:
        return dict(zip(EXCEPTIONS, pool.map(end, EXCEPTIONS), strict=True))


@pytest.mark.parametrize("failure", EXCEPTIONS)
def test_an_exception_on_one_rank(ended, failure):
    status, lines, seconds, left = ended[failure]
    assert (status, lines[-1]) == EXCEPTIONS[failure]
    assert len(lines) == 1 or failure == "error"
    assert seconds < limit() and left


@pytest.mark.parametrize("victim", range(RANKS))
def test_a_killed_rank(tmp_path, victim):
    """mpiexec hears of it and ends the others, which wait for it in a collective call."""
    job = Job("sleep", tmp_path)
    os.kill(job.pids[victim], signal.SIGKILL)
    status, lines, seconds = job.end()
    assert status != 0 and lines == [] and seconds < limit()
    assert gone(job.pids, 2)


def test_a_killed_mpiexec_leaves_no_orphans(tmp_path):
    job = Job("sleep", tmp_path)
    job.process.kill()
    assert gone(job.pids, limit())
    job.process.communicate(timeout=60)


def test_an_interrupted_mpiexec_leaves_no_orphans(tmp_path):
    """Control-C."""
    job = Job("sleep", tmp_path)
    job.process.send_signal(signal.SIGINT)
    status, _, seconds = job.end()
    assert status != 0 and seconds < limit() and gone(job.pids, 2)


# --- unequal input


def unequal(tmp_path, *programs):
    """One rank each with words and a folder of its own; status and our lines."""
    mpiexec = shutil.which("mpiexec")
    if mpiexec is None:
        pytest.skip("no mpiexec")
    command = [mpiexec]
    for k, words in enumerate(programs):
        folder = tmp_path / str(k)
        folder.mkdir(exist_ok=True)
        command += [*([":"] if k else []), "-n", "1", "-wdir", str(folder), sys.executable, "-m", "lcp_lube", *words.split()]
    done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == "" and "Traceback" not in done.stderr
    return done.returncode, [line for line in done.stderr.splitlines() if line.startswith("lcp-lube: ")]


def test_unequal_command_lines(tmp_path):
    status, lines = unequal(tmp_path, "solve problem1 --n 30", "solve problem1 --n 31")
    assert status == 2 and lines == ["lcp-lube: command line: not the same on rank 0 and on rank 1"]


def test_unequal_scene_files(tmp_path):
    for k, h_min in enumerate(("1e-5", "2e-5")):
        (tmp_path / str(k)).mkdir()
        (tmp_path / str(k) / "my.toml").write_text(f"family = 'slider'\nh_min = {h_min}\nn = 30\n")
    status, lines = unequal(tmp_path, "solve my.toml", "solve my.toml")
    assert status == 2 and lines == ["lcp-lube: scene my or how to solve it: not the same on rank 0 and on rank 1"]


def test_a_scene_file_that_one_rank_lacks(tmp_path):
    (tmp_path / "0").mkdir()
    (tmp_path / "0" / "my.toml").write_text("family = 'slider'\nh_min = 1e-5\nn = 30\n")
    status, lines = unequal(tmp_path, "solve my.toml", "solve my.toml")
    assert status == 2 and lines == ["lcp-lube: my.toml: No such file or directory"]
