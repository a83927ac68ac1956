"""Sweeps in several processes: the same csv as with one, taken up again, interrupted, and with a process that dies."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ENVIRONMENT

from lcp_lube.cli import sweep_jobs
from lcp_lube.cli.sweep_jobs import HEAVY, WORTH, jobs_for, side_by_side
from lcp_lube.errors import InputError

OWN = {"time_s", "memory_mb", "memory_base_mb", "memory_estimate_mb"}  # what differs from process to process
WORDS = ("sweep", "problem1", "--n", "30", "--vary", "U=1,5", "--vary", "h_max=20um:60um:3")


def table(path):
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        return reader.fieldnames, [{key: value for key, value in row.items() if key not in OWN} for row in reader]


def test_the_same_csv(cli, tmp_path):
    """Rows, their order and their columns; with points that fail, and when half of them stand in the file already."""
    few = ("--method", "din", "--max-it", "30")
    for jobs in (1, 2):
        done = cli(*WORDS, *few, "--jobs", jobs, "--output", f"{jobs}.csv")
        assert done.status == 1
    one, two = table(tmp_path / "1.csv"), table(tmp_path / "2.csv")
    assert one == two and {"converged", "max_iterations"} == {row["outcome"] for row in one[1]}
    assert done.lines[-1].startswith("sweep: 6 points, ")
    lines = (tmp_path / "1.csv").read_text().splitlines(keepends=True)
    (tmp_path / "1.csv").write_text("".join(lines[:4]))
    assert cli(*WORDS, *few, "--jobs", 2, "--output", "1.csv").status == 1
    assert table(tmp_path / "1.csv") == two
    assert (tmp_path / "1.csv").read_text().splitlines(keepends=True)[:4] == lines[:4]


def test_interrupted(tmp_path):
    """What was found is in the file, and no process is left behind."""
    words = [
        *WORDS[:4],
        "--vary",
        "U=1:5:30",
        "--vary",
        "h_max=20um:60um:30",
        "--jobs",
        "2",
        "--output",
        str(tmp_path / "s.csv"),
    ]
    sweep = subprocess.Popen([sys.executable, "-m", "lcp_lube", *words], env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)
    try:
        while sweep.poll() is None and not ((tmp_path / "s.csv").exists() and len(rows(tmp_path)) > 4):
            time.sleep(0.05)
        sweep.send_signal(signal.SIGINT)
        _, said = sweep.communicate(timeout=60)
    finally:
        sweep.kill()
    assert sweep.returncode == 130 and said.strip().splitlines() == ["lcp-lube: interrupted"]
    assert 4 < len(rows(tmp_path)) < 900 and [path.name for path in tmp_path.iterdir()] == ["s.csv"]
    assert not [found for found in processes() if str(tmp_path) in found]


def rows(folder):
    return (folder / "s.csv").read_text().splitlines()


def processes():
    """Command lines of all processes."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            yield path.read_text()
        except OSError:
            continue


def test_a_process_that_dies_is_a_row(monkeypatch):
    """And the next one goes on behind it."""
    ends = 'import sys; k = sys.stdin.readline(); print(\'{"outcome": "converged"}\', flush=True); sys.exit(3)'

    def start(*_: object, **__: object):
        return subprocess.Popen([sys.executable, "-c", ends], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(sweep_jobs, "begin", start)
    found = dict(side_by_side([], 1, [[0, 1, 2]]))
    assert [found[k]["outcome"] for k in range(3)] == ["converged", "crashed", "converged"]
    assert found[1]["message"] == "its process ended with status 3"


def test_how_many(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: range(8), raising=False)
    monkeypatch.setattr(sweep_jobs, "launched", lambda: False)
    assert jobs_for(3, 2, [10]) == 2 and jobs_for(3, 5, [10]) == 3
    assert jobs_for(None, 5, [10] * 5) == 1 and jobs_for(None, 5, [WORTH // 5] * 5) == 5 and jobs_for(None, 9, [HEAVY] * 9) == 8
    assert jobs_for(None, 5, [HEAVY + 1] * 50) == 1
    monkeypatch.setattr(sweep_jobs, "launched", lambda: True)
    assert jobs_for(None, 9, [HEAVY] * 9) == 1
    with pytest.raises(InputError, match="--jobs 0: at least 1"):
        jobs_for(0, 5, [10])


def test_not_under_mpiexec(cli):
    done = cli(*WORDS, "--jobs", 2, ranks=2)
    assert done.status == 2 and done.lines == ["lcp-lube: --jobs 2: not under mpiexec, whose ranks share each solve"]
