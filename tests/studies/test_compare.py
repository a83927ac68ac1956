"""`compare`: every combination a row, failures too; figures from the same run as `solve` would give."""

import json
from typing import Any

import pytest

from lcp_lube import InputError, load_scene, solve
from lcp_lube.output.results import as_dict
from lcp_lube.studies import experiment
from lcp_lube.studies.compare import compare, exact_errors, table


def test_rows_are_the_runs_that_solve_makes() -> None:
    """Methods by recipes, in this order; counts and load as by `solve`, errors against the exact solution beside them."""
    scene = load_scene("problem2", {"n": 60})
    rows = compare(scene, ["din", "fbn-a"], ["superlu", "gmres_ilu"], system="full")
    assert [(row["method"], row["recipe"]) for row in rows] == [
        ("din", "superlu"),
        ("din", "gmres_ilu"),
        ("fbn-a", "superlu"),
        ("fbn-a", "gmres_ilu"),
    ]
    assert all(row["converged"] for row in rows)
    alone = solve(scene, method="din", recipe="gmres_ilu", system="full")
    data = as_dict(alone)
    alone.destroy()
    for key in ("iterations", "linear_iterations", "load", "min_p", "min_r", "residual", "complementarity"):
        assert rows[1][key] == data[key], key
    exact = scene.exact()
    assert rows[0]["load_error"] == pytest.approx(abs(data["pressure_integral"] / exact.load - 1), rel=1e-3)
    assert rows[0]["rupture_error"] == pytest.approx(abs(data["rupture"] - exact.rupture) / 0.1, abs=1e-9)
    assert rows[0]["rupture_error"] < 1 / 61  # the front is within a cell


def test_errors_do_not_depend_on_the_cavitation_pressure() -> None:
    """Pressures are absolute: p_c is in the run's p_max, not in the exact solution's."""
    rows = [compare(load_scene("problem1", {"n": 50, "p_c": p_c}), ["active-set"])[0] for p_c in (0.0, 3e5)]
    assert rows[0]["p_max"] + 3e5 == pytest.approx(rows[1]["p_max"], rel=1e-12)
    assert rows[1]["load_error"] == pytest.approx(rows[0]["load_error"], rel=1e-6)


def test_a_full_film_has_no_rupture_error() -> None:
    """Exact load, but no rupture in either solution."""
    rows = compare(load_scene("problem2", {"n": 40, "p_a": 5e7, "p_b": 5e7}), ["active-set"])
    assert rows[0]["load_error"] < 1e-3
    assert "rupture_error" not in rows[0]


def test_no_exact_solution_in_2d() -> None:
    solution = solve(load_scene("problem4", {"n": 10}))
    assert exact_errors(solution.problem, as_dict(solution)) == {}
    solution.destroy()


def test_failures_are_rows() -> None:
    """A run out of iterations, one whose certificate fails, one that is refused: rows, and sentences under the table."""
    scene = load_scene("problem1", {"n": 100})
    options: dict[str, dict[str, Any]] = {"din": {"conditions": "B"}, "fbn-a": {}, "active-set": {"gamma": 0.4}}
    rows = compare(scene, list(options), ["superlu"], stopping={"max_it": 15}, options=options.__getitem__)
    assert [row["outcome"] for row in rows] == ["wrong_solution", "converged", "refused"]
    lines = table(rows).splitlines()
    assert len(lines) == 1 + 3 + 2
    assert lines[-2].startswith("din, superlu: ") and "certificate fails" in lines[-2]
    assert lines[-1].startswith("active-set, superlu: active-set.gamma")
    out_of_iterations = compare(scene, ["din"], stopping={"max_it": 3})[0]
    assert (out_of_iterations["outcome"], out_of_iterations["iterations"]) == ("max_iterations", 3)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"methods": ["din", "dinn"]}, r"--methods dinn: .*nearest is din"),
        ({"recipes": ["superlu", "supelu"]}, r"--recipe supelu: .*nearest is superlu"),
        ({"system": "ful"}, r"--system ful: .*nearest is full"),
        ({"options": lambda method: {"gama": 0.4}}, r"din\.gama: .*nearest is gamma"),  # no row could be run
    ],
)
def test_unknown_names(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        compare(load_scene("problem1", {"n": 10}), **{"methods": ["din"], **change})


def test_table_leaves_empty_columns_out() -> None:
    """2D: no errors to print; columns line up under their headings."""
    text = table(compare(load_scene("problem4", {"n": 12}), ["active-set", "din-pc"])).splitlines()
    assert "err" not in text[0] and "residual" in text[0]
    at = text[0].index("outcome")
    assert all(line[at:].startswith("converged") and line[at - 2 : at] == "  " for line in text[1:])


def test_command_on_three_ranks(cli: Any) -> None:
    """One table from rank 0; MUMPS as on one rank, SuperLU refused there; exit status 1 for that."""
    words = ["compare", "problem4", "--nx", 13, "--ny", 7, "--methods", "din", "--recipes", "mumps,superlu", "--json"]
    one, three = cli(*words), cli(*words, ranks=3)
    assert (one.status, three.status) == (0, 1)
    rows = three.json
    assert json.dumps(rows).count("refused") == 1 and rows[1]["recipe"] == "superlu"
    for key in ("iterations", "centrality", "backtracking"):
        assert rows[0][key] == one.json[0][key]
    assert rows[0]["load"] == pytest.approx(one.json[0]["load"], rel=1e-10)


def test_command_nested(cli: Any) -> None:
    """--nested reaches the runs."""
    run = cli("compare", "problem1", "--n", 100, "--methods", "active-set", "--nested", "--json")
    assert len(run.json[0]["levels"]) > 1


def test_a_film_without_anything_to_solve_is_a_run_too() -> None:
    found = experiment.run(load_scene("problem4", {"n": 20, "U": 0.0}))
    assert (found["outcome"], found["method"], found["iterations"]) == ("converged", "none", 0)
