"""The machinery of the performance benchmarks: peers agree with the references, rows are kept, a failed run is a row."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lcp_lube.scenes.scene import load_scene

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

import peers  # noqa: E402
import performance  # noqa: E402


@pytest.mark.parametrize("name", ["scipy", "scipy_mmd", "ssls", "rsls", "tao_ssils"])
def test_peers_solve_the_same_equations(name):
    problem = load_scene("textured_slider", {"K": 1}).build()
    row = peers.run(name, problem)
    assert row["outcome"] == "converged", row["message"]
    assert row["p_max"] == pytest.approx(482112.287892, rel=1e-6)
    assert row["force"] == pytest.approx(-230.290207, rel=1e-6)
    problem.destroy()


def test_a_peer_that_fails_is_a_row(monkeypatch):
    problem = load_scene("textured_slider", {"K": 1}).build()
    monkeypatch.setattr(peers, "MAX_IT", 1)
    assert peers.run("scipy", problem)["outcome"] == "failed"
    problem.destroy()


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.hypre
def test_cases_are_kept_and_not_run_again(tmp_path, monkeypatch):
    words = [sys.executable, str(BENCHMARKS / "performance.py"), "line", "--quick", "--results", str(tmp_path)]
    first = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert first.returncode == 0, first.stderr
    rows = rows_of(tmp_path / "performance_quick.csv")
    assert [row["scene"] for row in rows] == ["problem1", "problem3"] and {row["outcome"] for row in rows} == {"converged"}

    def not_again(*_args):
        raise AssertionError("the case ran again")

    monkeypatch.setattr(performance, "child", not_again)
    monkeypatch.setattr(sys, "argv", words[1:])
    performance.main()
    assert rows_of(tmp_path / "performance_quick.csv") == rows


@pytest.mark.hypre
def test_a_case_that_breaks_is_a_row(tmp_path, monkeypatch):
    monkeypatch.setattr(performance, "cases", lambda *_: [performance.Case("line", "problem1", {"n": -1}, ("default",))])
    monkeypatch.setattr(sys, "argv", ["performance.py", "line", "--quick", "--results", str(tmp_path)])
    performance.main()
    (row,) = rows_of(tmp_path / "performance_quick.csv")
    assert row["outcome"] == "failed" and "greater than or equal to 1" in row["message"]


def test_printed_seconds_of_the_paper():
    case = performance.Case("tables", "problem1", {"n": 1000}, ())
    assert performance.printed(case, "din", "full", "superlu") == "0.73"
    assert performance.printed(case, "din", "full", "lu") == "17.74"
    assert performance.printed(case, "din", "full", "gmres_ilu") == "1.22"
    assert performance.printed(case, "active-set", "reduced", "superlu") == ""


@pytest.mark.hypre
def test_chart_scaling(cli):
    run = cli("chart", "scaling", "--quick", ranks=2, timeout=120)
    assert run.status == 0, run.err
    assert re.search("weak +problem4", run.out) and "rough" in run.out
