"""The charts: runs in a csv that is taken up again, pictures from it, what is said of them, bad input."""

import csv
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from drawn_text import overlapping
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Text

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.registry import METHODS, STABILITY, MethodEntry
from lcp_lube.scenes.scene import load_scene
from lcp_lube.studies import experiment, known, precision, turning_point
from lcp_lube.studies.drawing import CHART
from lcp_lube.studies.log import NAME, load, write_log
from lcp_lube.studies.map_picture import Axis, Panels, chosen, converged, tick
from lcp_lube.studies.map_picture import picture as map_picture
from lcp_lube.studies.outcome_map import tallies, tally
from lcp_lube.studies.precision_picture import against_krylov, against_seconds, parts
from lcp_lube.studies.precision_words import cheapest, error, fastest, front, loose, seconds, sentence, timed, which
from lcp_lube.studies.reference import WRONG, References
from lcp_lube.studies.starts import apart, equal_starts, lines_sentence, map_sentence, with_rules

Row = dict[str, str]


def read(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a quick precision chart of a line and a square, and of every quick map."""
    folder = tmp_path_factory.mktemp("charts")
    assert precision.chart(["problem1", "problem4"], quick=True, results=folder) == 0
    for entry in STABILITY.values():
        assert entry.load()(quick=True, results=folder) == 0
    return folder


@pytest.mark.hypre
def test_every_method_of_the_registry_is_in_the_chart(quick: Path) -> None:
    rows = [row for row in read(quick / "precision_quick.csv") if row["method"] != "auto --accuracy"]
    films = {method: entry for method, entry in METHODS.items() if "lubrication" in entry.kinds}
    wanted = {(method, system) for method, entry in films.items() for system in entry.systems or ("auto",)}
    assert {(row["method"], row["system"]) for row in rows if row["scene"] == "problem4"} == wanted
    assert {row["eps"] for row in rows} == {"0.0001", "1e-08"}
    assert {row["method"] for row in rows if row["nested"] == "True"} == {m for m, e in films.items() if e.nested}


@pytest.mark.hypre
def test_errors_are_those_of_the_scheme_and_of_the_iteration(quick: Path) -> None:
    """Problem 1 at n = 100: about 1e-4 in the load, the same for all methods; the iteration's part vanishes with eps."""
    rows = [row for row in read(quick / "precision_quick.csv") if converged(row) and row["eps"] == "1e-08"]
    assert len(rows) > 20
    for row in rows:
        assert float(row["load_iteration"]) < 1e-6
        whole, grid = float(row["load_error"]), float(row["load_grid"])
        assert whole == pytest.approx(grid, rel=1e-4, abs=1.1 * float(row["load_iteration"]))
        if row["scene"] == "problem1" and row["n"] == "100":
            assert row["known"] == "exact"
            assert 5e-5 < float(row["load_error"]) < 2e-4
            assert float(row["rupture_error"]) < 1e-3
            assert float(row["p_max_error"]) < 1e-3
        assert 0 < seconds(row) <= float(row["wall_s"])
        assert not loose(row, "load")
    assert any(float(row["krylov"]) > 0 for row in rows)


@pytest.mark.rounding
def test_accuracy_that_was_asked_for_is_in_the_chart(quick: Path) -> None:
    rows = chosen(read(quick / "precision_quick.csv"), method="auto --accuracy", scene="problem1")
    assert len(rows) == 2
    for row in rows:
        assert converged(row)
        assert float(row["load_error"]) <= float(row["eps"])


def test_limit_of_fine_grids_is_the_exact_solution() -> None:
    """Where both are known: Richardson's limit is as near to the exact numbers as it says, within a factor."""
    scene = precision.film("problem3")
    exact, limit = known.known_answer(scene, Path("unused.csv")), known.fine(scene, (255, 511, 1023))
    assert exact.how == "exact"
    for name in ("load", "p_max"):
        value = exact.values[name]
        assert value is not None
        off = abs(float(str(limit[name])) / value - 1)
        assert off < max(10 * float(str(limit[f"{name}_unsure"])), 1e-13) < 1e-3  # problem 3's p_max is exact on every grid


@pytest.mark.parametrize("second, most", [(2.0, 250.0), (1.5, 15.0)])
def test_limit_of_many_grids_is_as_near_as_it_says(second: float, most: float) -> None:
    """Values with errors a h + b h^p and a scatter, as large as those of a pad with round dimples: nine of ten draws."""
    rng = np.random.default_rng(7)
    sides = np.geomspace(700, 8450, 72).round()
    h = 1.0 / (sides + 1.0)
    right = []
    for _ in range(200):
        errors = rng.uniform(-1, 1) * h + rng.uniform(-most, most) * h**second + 0.7 * rng.standard_normal(72) * h**1.3
        limit, doubt = known.fitted(sides.tolist(), (3.0 * (1.0 + errors)).tolist())
        right.append(abs(limit - 3.0) <= doubt)
        assert 0.0 < doubt < 3.0 * 1e-4
    assert np.mean(right) > 0.9


@pytest.mark.hypre
def test_second_time_nothing_is_run(quick: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def no_run(*_: Any, **__: Any) -> None:
        raise AssertionError("a run was made again")

    for module in (experiment, precision, known):
        for name in ("solve", "run", "fine"):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, no_run)
    monkeypatch.setattr(turning_point, "branch", no_run)
    maps = [f"stability_{name}_quick.png" for name in STABILITY if name != "starts"]
    kinds = ("load", "p_max", "rupture", "krylov", "parts")
    wanted = [*(f"precision_quick_{kind}.png" for kind in kinds), "starts_quick_lines.png", "starts_quick_map.png", *maps]
    assert sorted(path.name for path in quick.glob("*.png")) == sorted(wanted)
    before = {path.name: path.read_bytes() for path in quick.iterdir()}
    for name in wanted:
        assert before[name].startswith(b"\x89PNG")
        (quick / name).unlink()
    precision.chart(["problem1", "problem4"], quick=True, results=quick)
    STABILITY["turning_point"].load()(quick=True, results=quick)
    after = {path.name: path.read_bytes() for path in quick.iterdir()}
    assert after.keys() == {name for name in before if name not in wanted[5:] or "turning" in name}
    assert all(data == before[name] for name, data in after.items())
    assert capsys.readouterr().out.count("runs, 0 of them new") == 2


def test_words_name_the_cheapest_run(quick: Path) -> None:
    rows = read(quick / "precision_quick.csv")
    lines = cheapest(rows)
    best = fastest([row for row in rows if row["scene"] == "problem1"], 1e-3)
    assert best is not None
    assert any(line.startswith(f"  fastest within 0.1 %: {best['method']}") for line in lines)
    assert sum(line.startswith("problem") for line in lines) == 2
    assert best["method"] in sentence(rows, "load")
    other = {**best, "system": "peer", "method": "another code", "wall_s": str(3 * seconds(best)), "cpu_s": "1e9"}
    found = next(line for line in which([*rows, other]) if line.startswith("| problem1 | 1 %"))
    assert "| another code, 3 times |" in found


def test_what_was_not_run_is_told_from_what_is_beyond_a_method() -> None:
    run = {
        "scene": "a",
        "system": "full",
        "nested": "False",
        "outcome": "converged",
        "recipe": "r",
        "eps": "1e-8",
        "cpu_s": "1",
    }

    def row(method: str, n: int, error: float) -> Row:
        return {**run, "method": method, "n": str(n), "points": str(n * n), "wall_s": str(n), "load_error": str(error)}

    coarse = [row("fas", 10, 1e-2), row("fas", 40, 1e-5), row("din", 10, 1e-2)]
    assert "not run above 10 a side: minutes" in which(coarse)[-1]
    assert which(coarse)[-1].endswith("| not run |")  # of other codes nothing at all
    assert any(text.startswith("  din ") and text.endswith("not run   not run") for text in cheapest(coarse))
    tried = [*coarse, row("din", 40, 1e-3)]
    assert "does not get there" in which(tried)[-1]
    assert any(text.startswith("  din ") and text.endswith("-         -") for text in cheapest(tried))


def test_seconds_of_another_or_a_busy_machine_are_not_compared() -> None:
    run = {
        "scene": "a",
        "system": "auto",
        "method": "fas",
        "nested": "False",
        "recipe": "r",
        "n": "9",
        "points": "9",
        "eps": "1e-8",
    }
    run |= {
        "cpu_s": "1",
        "wall_s": "1",
        "outcome": "converged",
        "load_error": "1e-5",
        "machine": "one, 2 cores",
        "load_average": "",
    }
    fast = {**run, "cpu_s": "0.1"}
    rows = [
        run,
        run,
        run,
        {**fast, "machine": "other, 2 cores"},
        {**fast, "load_average": "2.5"},
        {**run, "load_average": "1.5"},
    ]
    assert timed(rows) == [run, run, run, rows[-1]]
    assert sentence(rows, "load").endswith("Seconds are not compared of 2 runs of another or a busy machine.")
    assert "| 1 s |" in which(rows)[-1]


def test_the_load_of_the_machine_is_told() -> None:
    row = {"date": "2026-01-02", "machine": "a machine", "petsc": "3.18.5"}
    assert load([row]) == "load average not noted"
    busy = [{**row, "load_average": "1.5"}, {**row, "load_average": "13.0"}, row]
    assert load(busy) == "load average 1.5 to 13 in 2 runs, not noted in 1 stored ones"
    assert float(experiment.environment()["load_average"]) >= 0.0


@pytest.fixture
def printed() -> Iterator[None]:
    """The charts' own sizes of type."""
    with matplotlib.rc_context(CHART):
        yield


def stored(name: str) -> list[Row]:
    return read(Path(__file__).parents[2] / "benchmarks" / "results" / f"{name}.csv")


@pytest.mark.parametrize(
    "draw", [lambda rows: against_seconds(rows, "load"), lambda rows: against_seconds(rows, "rupture"), against_krylov, parts]
)
def test_panels_of_the_full_chart_can_be_read(draw: Any, printed: None) -> None:
    """At most seven lines a panel, none empty, no text over another, nothing set smaller than 6.5 points."""
    rows = stored("precision")
    figure = draw(rows)
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert len(panels) >= 5  # places of ruptures that every grid has to rounding are not drawn
    for axes in panels:
        lines = [
            line
            for line in axes.lines
            if len(line.get_xdata()) and line.get_marker() != "x" and line.get_linestyle() not in (":", "None")
        ]
        colours = {line.get_color() for line in lines if line.get_linewidth() < 3.0}
        assert 1 <= len(colours) <= 7
        low, high = axes.get_ylim()
        assert any(low <= y <= high for line in lines for y in line.get_ydata())
    legend = next(found for axes in figure.axes if (found := axes.get_legend()))
    black = [str(line.get_label()) for line in legend.get_lines() if line.get_color() == "#000000"]
    assert all(name.startswith("other codes") for name in black)  # a colour that no method has
    assert overlapping(figure) == []
    assert min(float(text.get_fontsize()) for text in figure.findobj(Text) if text.get_text().strip()) >= 6.5


@pytest.mark.parametrize("name", ["film_ratio", "roughness", "supply_speed", "conditions", "inner_tolerance", "turning_point"])
def test_full_maps_can_be_read(name: str, printed: None) -> None:
    module = STABILITY[name].load().__self__
    rows = stored(f"stability_{name}")
    figure = map_picture(rows, module.panels, module.x, module.y, module.sentence(rows), module.right)
    assert overlapping(figure) == []
    assert min(float(text.get_fontsize()) for text in figure.findobj(Text) if text.get_text().strip()) >= 6.5


def test_failures_are_rows_and_crosses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run past the Krylov limit is a row, larger grids are then left out; a wrong solution is no point of a line."""
    monkeypatch.setattr(precision, "KRYLOV_MOST", 100)
    store = experiment.open_store(tmp_path / "a.csv", precision.KEY, precision.COLUMNS)
    scene = precision.film("problem1")
    bench = precision.Bench(scene, known.known_answer(scene, tmp_path / "known.csv"), 1)
    bench.fill(store, precision.Configuration("din", False, "full", "gmres_ilu", 1e-8), (50, 100, 200))
    assert [row["outcome"] for row in store.rows] == [experiment.KRYLOV_LIMIT]
    assert int(store.rows[0]["linear_iterations"]) > 100
    assert "100 Krylov iterations" in store.rows[0]["message"]
    assert error(store.rows[0], "load") is None
    slow = experiment.run(scene, cpu_limit=0.0, method="din")
    assert slow["outcome"] == experiment.TIME_LIMIT and slow["iterations"] == 1 and "left after 0 s" in slow["message"]
    figure = against_seconds(store.rows, "load")
    crosses = [line for axes in figure.axes for line in axes.lines if line.get_marker() == "x" and len(line.get_xdata())]  # type: ignore[arg-type]
    assert [len(line.get_xdata()) for line in crosses] == [1]  # type: ignore[arg-type]


def test_a_registry_line_is_enough_to_join(monkeypatch: pytest.MonkeyPatch) -> None:
    before = list(precision.configurations(1))
    monkeypatch.setitem(METHODS, "another", MethodEntry("somewhere:build", "a method", systems=("reduced", "new")))
    monkeypatch.setitem(METHODS, "for-boxes", MethodEntry("somewhere:build", "another kind", kinds=("box",)))
    joined = [c for c in precision.configurations(1) if c not in before]
    assert {c.method for c in joined} == {"another"}
    assert {c.recipe for c in joined if c.system == "reduced"} == set(precision.RECIPES[1]["reduced"])
    assert {c.recipe for c in joined if c.system == "new"} == {None}


def test_an_edited_scene_is_another_one() -> None:
    scene = load_scene("problem2")
    assert experiment.scene_key(scene) == experiment.scene_key(load_scene("problem2", {"n": 333}))
    assert experiment.scene_key(scene) != experiment.scene_key(load_scene("problem2", {"p_b": 2e6}))


@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-9, 1.0), st.booleans()), max_size=30))
def test_front_is_what_no_run_beats(runs: list[tuple[float, float, bool]]) -> None:
    rows = [
        {"wall_s": str(t), "cpu_s": str(2 * t), "load_error": str(e), "outcome": "converged" if good else "max_iterations"}
        for t, e, good in runs
    ]
    best = front(rows, "load")
    times, errors = [seconds(row) for row in best], [error(row, "load") for row in best]
    assert times == sorted(times)
    assert errors == sorted(set(errors), reverse=True)  # type: ignore[type-var]
    for t, e, good in runs:
        assert not good or any(a <= t and 0.9 * b <= e for a, b in zip(times, errors, strict=True))  # type: ignore[operator]


def test_error_of_an_iteration_that_stops_where_errors_cancel() -> None:
    row = {"outcome": "converged", "load_error": "1e-9", "load_grid": "1e-6", "load_iteration": "1e-5", "rupture_error": ""}
    assert error(row, "load") == 1e-5
    assert loose(row, "load")
    assert error(row, "rupture") is None
    assert error({**row, "outcome": "wrong_solution"}, "load") is None


def test_wrong_is_what_is_far_from_the_proved_solution() -> None:
    """A run whose own certificate holds is still wrong where the reference is another one."""
    scene = load_scene("problem2", {"n": 30})
    reference = References().of(scene)
    assert "proved" in reference.how
    right = experiment.run(scene, reference=reference, method="din")
    assert right["outcome"] == "converged"
    assert float(right["distance"]) < 1e-6
    other = References().of(load_scene("problem2", {"n": 30, "U": 5.3}))
    wrong = experiment.run(scene, reference=other, method="din")
    assert wrong["outcome"] == "wrong_solution"
    assert float(wrong["distance"]) > WRONG
    assert "from the reference" in wrong["message"]


def test_turning_point_of_bratu() -> None:
    """The curve of solutions by the mean of v has the published turning point in the limit, and lies on both branches."""
    curves = [turning_point.Branch(n) for n in (7, 15)]
    limit = curves[1].turning + (curves[1].turning - curves[0].turning) / 3  # second order
    assert limit == pytest.approx(6.808124, abs=1e-3)
    low, high = curves[0].solutions(6.0)
    assert low.max() < high.max()
    solution = solve(load_scene("bratu", {"n": 7, "lambda": 6.0}))
    assert np.abs(solution.fields["v"] - low).max() < 1e-7
    solution.destroy()
    assert curves[0].solutions(7.0) == ()


@pytest.mark.rounding
def test_maps_tell_who_fails_where(quick: Path) -> None:
    rows = read(quick / "stability_conditions_quick.csv")
    assert all(converged(row) for row in chosen(rows, conditions="FCB"))
    assert {row["outcome"] for row in chosen(rows, conditions="B", start="start 1, 0.1")} == {"wrong_solution"}
    assert all(row["reference"] for row in rows)
    films = read(quick / "stability_film_ratio_quick.csv")
    assert all(converged(row) for row in chosen(films, method="auto"))
    beyond = [row for row in read(quick / "stability_turning_point_quick.csv") if float(row["part"]) > 0]
    assert {row["outcome"] for row in beyond} == {"no_solution"}
    assert all(turning_point.right(row) for row in beyond)


@pytest.mark.rounding
def test_a_rows_command_makes_the_run_again(quick: Path, cli: Any) -> None:
    for name in ("conditions", "inner_tolerance"):
        row = read(quick / f"stability_{name}_quick.csv")[-1]
        again = cli(*shlex.split(row["command"])[1:], "--json").json
        assert str(again["iterations"]) == row["iterations"]
        assert again["outcome"] == row["outcome"]


@pytest.mark.rounding
def test_condition_31_is_lost_with_loose_inner_solves(quick: Path) -> None:
    rows = chosen(read(quick / "stability_inner_tolerance_quick.csv"), method="din")
    lost = {row["tol"]: float(row["lost_at"]) for row in rows if row["inner"].startswith("full")}
    assert lost["1e-12"] < 1e-8 < lost["0.0001"] < lost["0.5"]
    # sigma = ||F||/100, a tolerance of 1e-4 and n = 100 points: (31) ends once ||F|| < 1e-4 * 100 * sqrt(100)
    assert 1e-3 < lost["0.0001"] <= 0.1


def made_up(count: int, failed: set[int]) -> list[Row]:
    return [
        {"n": str(k), "y": "1", "m": "a", "iterations": str(k), "outcome": "max_iterations" if k in failed else "converged"}
        for k in range(1, count + 1)
    ]


def test_sentences_are_counted_from_the_rows() -> None:
    axis = Axis("n", "n", "n")
    assert tally(made_up(5, set()), (axis,)) == "all 5, in 5 steps at most"
    assert tally(made_up(5, {4, 5}), (axis,)) == "3 of 5 (fail: 2 at the iteration limit: n from 4)"
    assert tally(made_up(5, {1}), (axis,)) == "4 of 5 (fail: 1 at the iteration limit: n 1)"
    assert tallies(made_up(3, set()), ("m",), (axis,)) == "Right answers: a: all 3, in 3 steps at most."


def test_a_map_has_a_number_or_a_mark_in_every_cell() -> None:
    rows = made_up(6, {2, 3})
    axes = map_picture(rows, Panels("m"), Axis("n", "n"), Axis("y", "y"), "").axes[0]
    assert [text.get_text() for text in axes.texts] == ["1", "4", "5", "6"]
    assert [float(line.get_xdata()[0]) for line in axes.lines] == [1.0, 2.0]  # type: ignore[index, arg-type]
    assert [tick(value) for value in ("1e-6", "0.1", "30", "1000", "-0.01")] == [
        "$10^{-6}$",
        "0.1",
        "30",
        "$10^{3}$",
        "$-10^{-2}$",
    ]


def test_log_has_one_section_a_chart(tmp_path: Path) -> None:
    row = {"date": "2026-01-02", "machine": "a machine", "petsc": "3.18.5"}
    for name, text in (("b", "first"), ("a", "other"), ("b", "second")):
        write_log(tmp_path, name, [row], text, [tmp_path / f"{name}.png"])
    written = (tmp_path / NAME).read_text()
    assert written.count("## ") == 2
    assert "first" not in written
    assert written.index("## a") < written.index("## b")
    assert "b.png: 1 runs, 2026-01-02, a machine, PETSc 3.18.5; load average not noted." in written


@pytest.mark.rounding
def test_mu1_stalls_at_tiny_starts_and_mu2_does_not(quick: Path) -> None:
    rows = with_rules(read(quick / "starts_quick.csv"))
    equal = equal_starts(rows)
    failed = [row for row in chosen(equal, mu="mu1") if not converged(row)]
    assert {row["p0"] for row in failed} == {"1e-15"}
    assert {row["outcome"] for row in failed} == {"max_iterations"}
    assert all(converged(row) for mu in ("mu2", "adaptive") for row in chosen(equal, mu=mu, conditions="FCB"))
    said = lines_sentence(rows)
    assert f"mu1: {len(failed)} of {len(chosen(equal, mu='mu1'))} fail, the largest 1e-15 with recipe lu" in said
    assert f"mu2: all {len(chosen(equal, mu='mu2', conditions='FCB'))} converge" in said
    good = sum(converged(row) for row in chosen(rows, mu="mu1", recipe="lu"))
    assert f"by mu1: {good} of 16 converge" in map_sentence(rows)
    assert max(map(apart, rows)) == 18


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("precision", "bratu"), "bratu: it has no load"),
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
