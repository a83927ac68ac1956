"""Stability against loose inner solves: the floor of their tolerance by recipe and method, and what condition (31) says of it.

(31) is sigma_k > delta_k max((sqrt n + tau1 gamma)/(1 - tau1 gamma), (sqrt n + tau2 gamma)/sqrt n). delta_k here is the
relative tolerance that the inner solver was given in step k, which the floor keeps from falling with ||F|| as the paper's does.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..base.resumable import Row
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Step
from ..solvers.steplength import Centrality
from .map_picture import Axis, Panels, chosen, converged, groups
from .outcome_map import Case, OutcomeMap, tally

TOLERANCES = (1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.1, 0.5)
SCENES = {"problem1": {"n": 100}, "problem4": {"n": 24}}
SYSTEMS = {"full": ("gmres_ilu", "bcgs_ilu", "augmentation_amg"), "reduced": ("gmres_ilu", "bcgs_ilu", "bcgs_amg")}
FLOOR = {"din": "tol_min", "din-pc": "tol_min", "fbn-a": "tol_min", "active-set": "rtol"}  # the method's option for it
START, GAMMA, EPS1 = (1.0, 0.1), 0.5, 1e-8  # DIN's

X = Axis("tol", "least inner tolerance", "tolerance")
Y = Axis("inner", "system, recipe", "inner solver", number=False)


def cases(quick: bool) -> Iterator[Case]:
    """quick: three tolerances on the line, one recipe a system."""
    for method, option in FLOOR.items():
        for scene in [*SCENES][:1] if quick else SCENES:
            for system, recipes in SYSTEMS.items():
                for recipe in recipes[:1] if quick else recipes:
                    for tol in TOLERANCES[::4] if quick else TOLERANCES:
                        key = {"scene": scene, "method": method, "inner": f"{system}, {recipe}", "tol": tol}
                        choices = {"method": method, "system": system, "recipe": recipe, "options": {option: tol}}
                        yield Case(key, scene, SCENES[scene], choices | {"nested": False})


def condition(case: Case, steps: Sequence[Step]) -> dict[str, Any]:
    """Whether (31) held in every step of a run by DIN until ||F|| <= EPS1, and ||F|| where it was first lost. Collective."""
    if case.key["method"] != "din" or not steps:
        return {}
    problem = case.load().build()
    assert isinstance(problem, LubricationProblem)  # for the type checker: the scenes are films
    try:
        p, r = (np.full(problem.grid.local_size, value) for value in START)
        norm, n = problem.reduce.norm(problem.flow(p, r)), problem.size
        central = Centrality(problem.reduce, p * r, n, norm, GAMMA)
        norm = problem.reduce.norm(problem.flow(p, r), p * r)
    finally:
        problem.destroy()
    first, second = central.tau1 * GAMMA, central.tau2 * GAMMA
    worst = max((np.sqrt(n) + first) / (1.0 - first), (np.sqrt(n) + second) / np.sqrt(n))
    before = [norm, *(step.norm for step in steps)]
    lost = next((norm for norm, step in zip(before, steps, strict=False) if not step.sigma > step.rtol * worst), None)
    return {"held": int(lost is None or lost <= EPS1), "lost_at": None if lost is None else f"{lost:.3e}"}


def sentence(rows: Sequence[Row]) -> str:
    """By method the loosest tolerance at which all inner solvers converge, and for DIN whether (31) predicts failures."""
    parts = []
    for (method,), mine in groups(rows, ("method",)).items():
        good = {tol: all(map(converged, here)) for (tol,), here in groups(mine, ("tol",)).items()}
        safe = [tol for k, tol in enumerate(good) if all([*good.values()][: k + 1])]
        stands = f"all inner solvers stand {safe[-1]}" if safe else "no tolerance suits all inner solvers"
        parts.append(f"{method}: {stands}, {tally(mine, (X,))}")
    din = [row for row in chosen(rows, method="din") if row["held"]]
    held = [row for row in din if row["held"] == "1"]
    lost = [row for row in din if row["held"] == "0"]
    well = [float(row["lost_at"]) / float(row["c1"]) for row in lost if converged(row) and float(row["c1"]) > 0]
    text = f"(31) held until ||F|| <= {EPS1:g} in {len(held)} runs of din, of which {sum(map(converged, held))} are right; "
    text += f"it was lost before in {len(lost)}, of which {sum(map(converged, lost))} are right all the same"
    if well:
        text += f" (||F|| fell by 1e{np.log10(np.median(well)):.0f} more, median)"
        text += ": far from necessary" + ", if sufficient" * all(map(converged, held))
    return f"{'; '.join(parts)}. {text}."


chart = OutcomeMap(
    "inner_tolerance",
    cases,
    Panels("method", "scene", outlined=lambda row: row.get("held") == "1", outline_label="(31) held"),
    X,
    Y,
    sentence,
    more=condition,
    columns=("held", "lost_at"),
).chart
