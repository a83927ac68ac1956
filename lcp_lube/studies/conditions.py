"""Stability against the step-length conditions: all subsets of F, R, C, B on every kind of film, by mu and start (DIN)."""

from collections.abc import Iterator, Sequence
from itertools import combinations

from ..base.resumable import Row
from .map_picture import Axis, Panels, chosen, converged, groups, unique
from .outcome_map import Case, OutcomeMap, tally

SUBSETS = tuple("".join(subset) for size in range(5) for subset in combinations("FRCB", size))
SCENES = {
    "problem1": {"n": 100},
    "problem2": {"n": 100},
    "problem3": {"n": 100},
    "problem4": {"n": 20},
    "journal": {"nx": 36, "ny": 17},
    "textured_slider": {"K": 1, "n": 20},
    "rough": {"n": 20},
}
STARTS = {"start 1, 0.1": (1.0, 0.1), "start 1e-5, 1e-5": (1e-5, 1e-5)}
MUS = ("mu1", "mu2")
DIRECT = "umfpack"  # gives LAPACK's counts on the tables' rows, at a sparse solver's price

X, Y = Axis("problem", "problem", "problem", number=False), Axis("conditions", "conditions", "conditions", number=False)


def cases(quick: bool) -> Iterator[Case]:
    """quick: four subsets on two lines."""
    for name, (p0, r0) in STARTS.items():
        for mu in MUS:
            for scene in [*SCENES][:2] if quick else SCENES:
                for subset in ("B", "FB", "FCB", "FRCB") if quick else SUBSETS:
                    key = {"start": name, "mu": mu, "problem": short(scene), "conditions": subset or "none"}
                    options = {"p0": p0, "r0": r0, "mu": mu, "conditions": subset}
                    choices = {"method": "din", "system": "full", "recipe": DIRECT, "options": options}
                    yield Case(key, scene, SCENES[scene], choices)


def short(scene: str) -> str:
    """A scene's name as it fits under a column."""
    return {"textured_slider": "texture"}.get(scene, scene.replace("problem", ""))


def sentence(rows: Sequence[Row]) -> str:
    """Which subsets solve everything, what the default does, and which end in wrong answers."""
    total = len(groups(rows, ("start", "mu", "problem")))
    won = {subset: [row for row in chosen(rows, conditions=subset) if converged(row)] for subset in unique(rows, "conditions")}
    best = [subset for subset, good in won.items() if len(good) == total]
    default = tally(chosen(rows, conditions="FCB"), ())
    text = f"Of {total} problems, starts and rules for mu, solved by FCB (the default): {default}. "
    steps = {subset: sum(int(row["iterations"]) for row in won[subset]) for subset in best}
    if best:
        fewest = min(best, key=lambda subset: steps[subset])
        text += f"All are solved by {', '.join(best)}, with the fewest steps by {fewest} ({steps[fewest]} in all). "
    else:
        most = max(won, key=lambda subset: len(won[subset]))
        text += f"No subset solves all of them; most, {len(won[most])}, does {most}. "
    parts = []
    for feasible in (True, False):
        mine = [row for row in rows if row["conditions"].startswith("F") == feasible]
        wrong = sum(row["outcome"] == "wrong_solution" for row in mine)
        parts.append(
            f"{'with' if feasible else 'without'} F {sum(map(converged, mine))} of {len(mine)} runs are right, {wrong} wrong"
        )
    return f"{text}{'; '.join(parts)}."


chart = OutcomeMap("conditions", cases, Panels("mu", "start"), X, Y, sentence).chart
