"""Several methods and recipes on one scene, side by side."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any

from ..api import solve
from ..base.progress import Line
from ..errors import InputError, nearest
from ..output.results import as_dict
from ..output.table import table as table_lines
from ..problems.solution import Problem
from ..registry import METHODS, SYSTEMS, read_recipe
from ..scenes.scene import Scene
from ..solvers.newton import Stopping

# Key of a row, heading, format; times have keys of their own, see `table`.
COLUMNS = (
    ("method", "method", "s"),
    ("took_over", "taken over by", "s"),
    ("system", "system", "s"),
    ("recipe", "recipe", "s"),
    ("outcome", "outcome", "s"),
    ("iterations", "its", "d"),
    ("linear_iterations", "Krylov", "d"),
    ("total", "s", ".3f"),
    ("linear", "s linear", ".3f"),
    ("min_p", "min p Pa", ".1e"),
    ("min_r", "min r", ".1e"),
    ("residual", "residual", ".1e"),
    ("complementarity", "compl.", ".1e"),
    ("load_error", "load err", ".1e"),
    ("rupture_error", "rupt. err", ".1e"),
)


def compare(
    scene: Scene,
    methods: Sequence[str],
    recipes: Sequence[str | None] = (None,),
    system: str = "auto",
    stopping: Stopping | dict[str, Any] | None = None,
    options: Callable[[str], dict[str, Any]] = lambda method: {},
    nested: bool | None = None,
    rescue: bool = True,
) -> list[dict[str, Any]]:
    """Solve a scene by every method ('auto' is one) with every recipe (None: the default one). Collective.

    options : a method's own parameters, by its name; the others are as `api.solve` takes them.

    Returns
    -------
    list of dict : a run each, also one that failed. The keys of the command line's JSON, and where an exact solution is known
    `load_error` (relative) and `rupture_error` (relative to L). A combination that was refused (a recipe for one rank on
    several, a method that lacks the system) has the outcome 'refused'.

    Raises
    ------
    InputError : an unknown method, system or recipe; or every combination was refused, with the first one's reason.
    """
    for method in methods:
        _check("--methods", method, METHODS)
    _check("--system", system, SYSTEMS)
    for recipe in recipes:
        if recipe is not None:
            read_recipe(recipe)
    rows: list[dict[str, Any]] = []
    with Line() as line:
        how: dict[str, Any] = {"system": system, "stopping": stopping, "nested": nested, "rescue": rescue, "progress": line}
        for method, recipe in line.over(product(methods, recipes), lambda run: f"{run[0]}, run"):
            try:
                with solve(scene, method=method, recipe=recipe, options=options(method), **how) as solution:
                    data = as_dict(solution)
                    rows.append({**data, **exact_errors(solution.problem, data)})
            except InputError as error:
                asked = {"scene": scene.name, "method": method, "system": system, "recipe": recipe}
                rows.append({**asked, "outcome": "refused", "converged": False, "message": str(error)})
    if all(row["outcome"] == "refused" for row in rows):
        raise InputError(rows[0]["message"])
    return rows


def _check(option: str, name: str, known: Iterable[str]) -> None:
    if name not in ("auto", *known):
        raise InputError(f"{option} {name}: allowed are auto, {', '.join(known)}{nearest(name, known)}")


def read_off(problem: Problem, data: dict[str, Any]) -> dict[str, float | None]:
    """Numbers with errors: `load`, integral of p - p_c (N or N/m), p_max above p_c (Pa), rupture (m; 2D: middle line)."""
    if "load" not in data:
        return {}
    return {
        "load": data["pressure_integral"],
        "p_max": data["p_max"] - getattr(problem, "p_c", 0.0),
        "rupture": data["rupture"],
    }


def errors(found: Mapping[str, float | None], known: Mapping[str, float | None], L: float) -> dict[str, float]:
    """Errors of what `read_off` gives: `load_error` and `p_max_error` relative, `rupture_error` relative to the length L."""
    out = {}
    for name, value in known.items():
        size = L if name == "rupture" else abs(value or 0.0)
        here = found.get(name)
        if value is not None and here is not None and size > 0:
            out[f"{name}_error"] = abs(here - value) / size
    return out


def exact_errors(problem: Problem, data: dict[str, Any]) -> dict[str, float]:
    """`errors` against the exact solution, where the problem has one."""
    exact = known() if (known := getattr(problem, "exact", None)) else None
    if exact is None:
        return {}
    reference = {"load": exact.load, "p_max": exact.p_max, "rupture": exact.rupture}
    return errors(read_off(problem, data), reference, problem.grid.lengths[0])


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as text, columns that no row fills left out; why a run failed stands under the table."""
    flat = [{**row, **row.get("time_s", {})} for row in rows]
    columns = [column for column in COLUMNS if any(row.get(column[0]) is not None for row in flat)]
    cells = [[heading for _, heading, _ in columns]]
    for row in flat:
        cells.append(["-" if row.get(key) is None else format(row[key], form) for key, _, form in columns])
    lines = table_lines(cells, align="".join("<" if form == "s" else ">" for _, _, form in columns))
    failed = [
        f"{row['method']}, {row['recipe'] or 'default recipe'}: {row['message']}"
        for row in rows
        if row["outcome"] != "converged"
    ]
    return "\n".join([*lines, *failed])
