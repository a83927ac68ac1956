"""The charts: runs in a csv that is taken up again, pictures from it, what is said of them, bad input."""

import csv
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube.chart import experiment, precision, starts
from lcp_lube.chart.precision_picture import cheapest, error, fastest, front, picture, seconds
from lcp_lube.chart.starts_picture import apart, chosen, converged, equal_starts, lines_sentence, map_sentence
from lcp_lube.errors import InputError
from lcp_lube.registry import METHODS, MethodEntry
from lcp_lube.scene import load_scene

Row = dict[str, str]


def read(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a quick precision chart of problems 1 and 3 and of the quick map of starts."""
    folder = tmp_path_factory.mktemp("charts")
    assert precision.chart(["problem1", "problem3"], quick=True, results=folder) == 0
    assert starts.chart(quick=True, results=folder) == 0
    return folder


def test_every_method_of_the_registry_is_in_the_chart(quick: Path) -> None:
    rows = read(quick / "precision_quick.csv")
    wanted = {(method, system) for method, e in METHODS.items() if "lubrication" in e.kinds for system in e.systems}
    assert {(row["method"], row["system"]) for row in rows} == wanted
    assert {row["eps"] for row in rows} == {"0.0001", "1e-08"}
    assert {row["method"] for row in rows if row["nested"] == "True"} == {m for m, e in METHODS.items() if e.nested}


def test_errors_are_those_of_the_scheme(quick: Path) -> None:
    """Problem 1 at n = 100: about 1e-4 in the load, and the iteration's part vanishes with eps."""
    rows = [row for row in read(quick / "precision_quick.csv") if converged(row) and row["eps"] == "1e-08"]
    assert len(rows) > 20
    for row in rows:
        assert float(row["iteration_error"]) < 1e-6
        assert float(row["rupture_error"]) < 1e-3
        if row["scene"] == "problem1" and row["n"] == "100":
            assert 5e-5 < float(row["load_error"]) < 2e-4
        assert 0 < seconds(row) <= float(row["wall_s"])


def test_second_time_nothing_is_run(quick: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def no_run(*_: Any, **__: Any) -> None:
        raise AssertionError("a run was made again")

    monkeypatch.setattr(experiment, "solve", no_run)
    before = {path.name: path.read_bytes() for path in quick.glob("*.csv")}
    for path in quick.glob("*.png"):
        path.unlink()
    precision.chart(["problem1", "problem3"], quick=True, results=quick)
    starts.chart(quick=True, results=quick)
    assert {path.name: path.read_bytes() for path in quick.glob("*.csv")} == before
    pictures = sorted(path.name for path in quick.iterdir() if path.suffix != ".csv")
    assert pictures == [
        "precision_quick_load.png",
        "precision_quick_rupture.png",
        "starts_quick_lines.png",
        "starts_quick_map.png",
    ]
    assert all((quick / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    assert "0 of them new" in capsys.readouterr().out


def test_table_names_the_cheapest_run(quick: Path) -> None:
    rows = read(quick / "precision_quick.csv")
    lines = cheapest(rows)
    best = fastest([row for row in rows if row["scene"] == "problem1"], 1e-3)
    assert best is not None
    assert any(line.startswith(f"  fastest within 0.1 %: {best['method']}") for line in lines)
    assert sum(line.startswith("problem") for line in lines) == 2


def test_failures_are_rows_and_crosses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run past the Krylov limit is a row, larger grids are then left out; a wrong solution is no point of a line."""
    monkeypatch.setattr(precision, "KRYLOV_MOST", 100)
    store = experiment.open_store(tmp_path / "a.csv", precision.KEY, precision.COLUMNS)
    configuration = precision.Configuration("din", False, "full", "gmres_ilu", 1e-8)
    scene, exact = precision.with_exact(load_scene("problem1"))
    precision.fill(store, scene, exact, configuration, (50, 100, 200), 1)
    assert [row["outcome"] for row in store.rows] == [experiment.KRYLOV_LIMIT]
    assert int(store.rows[0]["linear_iterations"]) > 100
    assert "100 Krylov iterations" in store.rows[0]["message"]
    assert error(store.rows[0], "load") is None
    crosses = [line for axes in picture(store.rows, "load").axes for line in axes.lines if line.get_marker() == "x"]
    assert [len(line.get_xdata()) for line in crosses if len(line.get_xdata())] == [1]  # type: ignore[arg-type]


def test_a_registry_line_is_enough_to_join(monkeypatch: pytest.MonkeyPatch) -> None:
    before = list(precision.configurations())
    monkeypatch.setitem(METHODS, "another", MethodEntry("somewhere:build", "a method", systems=("reduced", "new")))
    monkeypatch.setitem(METHODS, "for-boxes", MethodEntry("somewhere:build", "another kind", kinds=("box",)))
    joined = [c for c in precision.configurations() if c not in before]
    assert {c.method for c in joined} == {"another"}
    assert {c.recipe for c in joined if c.system == "reduced"} == set(precision.RECIPES["reduced"])
    assert {c.recipe for c in joined if c.system == "new"} == {None}


def test_an_edited_scene_is_another_one() -> None:
    scene = load_scene("problem2")
    assert precision.scene_key(scene) == precision.scene_key(load_scene("problem2", {"n": 333}))
    assert precision.scene_key(scene) != precision.scene_key(load_scene("problem2", {"p_b": 2e6}))


@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-9, 1.0), st.booleans()), max_size=30))
def test_front_is_what_no_run_beats(runs: list[tuple[float, float, bool]]) -> None:
    rows = [
        {
            "wall_s": str(t),
            "cpu_s": str(2 * t),
            "load_error": str(e),
            "iteration_error": "",
            "outcome": "converged" if good else "max_iterations",
        }
        for t, e, good in runs
    ]
    best = front(rows, "load")
    times, errors = [seconds(row) for row in best], [error(row, "load") for row in best]
    assert times == sorted(times)
    assert errors == sorted(set(errors), reverse=True)  # type: ignore[type-var]
    for t, e, good in runs:
        assert not good or any(a <= t and 0.9 * b <= e for a, b in zip(times, errors, strict=True))  # type: ignore[operator]


def test_error_of_an_iteration_that_stops_where_errors_cancel() -> None:
    row = {"outcome": "converged", "load_error": "1e-9", "iteration_error": "1e-5", "rupture_error": ""}
    assert error(row, "load") == 1e-5
    assert error(row, "rupture") is None
    assert error({**row, "outcome": "wrong_solution"}, "load") is None


def test_mu1_stalls_at_tiny_starts_and_mu2_does_not(quick: Path) -> None:
    rows = read(quick / "starts_quick.csv")
    equal = equal_starts(rows)
    failed = [row for row in chosen(equal, mu="mu1") if not converged(row)]
    assert {row["p0"] for row in failed} == {"1e-15"}
    assert {row["outcome"] for row in failed} == {"max_iterations"}
    assert all(converged(row) for mu in ("mu2", "adaptive") for row in chosen(equal, mu=mu, conditions="FCB"))
    sentence = lines_sentence(rows)
    assert f"mu1: {len(failed)} of {len(chosen(equal, mu='mu1'))} fail, the largest 1e-15 with recipe lu" in sentence
    assert f"mu2: all {len(chosen(equal, mu='mu2', conditions='FCB'))} converge" in sentence
    good = sum(converged(row) for row in chosen(rows, mu="mu1", recipe="lu"))
    assert f"by mu1: {good} of 16 converge" in map_sentence(rows)
    assert max(map(apart, rows)) == 18


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("precision", "problem4"), "problem4: an exact solution with a load is needed"),
        (("precision", "problem9"), "nearest is problem"),
        (("stability", "strats"), "nearest is starts"),
        (("stability", "-ksp_type", "gmres"), "-ksp_type: the runs of a chart bring their own inner solvers"),
        (("accuracy",), "allowed are precision, stability"),
    ],
)
def test_bad_input_is_one_line(cli: Any, words: tuple[str, ...], said: str) -> None:
    run = cli("chart", *words)
    assert run.status == 2
    assert run.out == ""
    assert len(run.lines) == 1
    assert said in run.lines[0]


def test_a_file_that_is_no_chart_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precision_quick.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="no csv of this experiment"):
        precision.chart(["problem1"], quick=True, results=tmp_path)
