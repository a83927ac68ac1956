"""The answer that runs are judged by: the discrete solution on the same grid, found and proved apart from them."""

from dataclasses import dataclass

import numpy as np

from ..api import solve
from ..base.parallel import Array
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields, Problem
from ..scenes.published import LubricationScene
from ..scenes.scene import Scene
from ..solvers.newton import Stopping

WRONG = 1e-2  # distance from which a run that believes in its answer is wrong: a per cent of p_max, or of the film's content
NEGLIGIBLE = 1e-6  # below it a film with no pressure at all is compared with what it could build up
TIGHT = Stopping(1e-12, np.inf)


@dataclass(frozen=True)
class Reference:
    """Fields of possible answers, of which a run may find any (equations can have two solutions), and how they are known.

    solvable : False where it is known that there is none.
    """

    answers: tuple[Fields, ...] = ()
    how: str = "none"
    solvable: bool = True

    def distance(self, problem: Problem, fields: Fields) -> float | None:
        """To the nearest answer: largest difference of p or v, relative to `_size`, or of r; None without any. Collective."""

        def apart(name: str, known: Array) -> float:
            return problem.reduce.max(np.abs(fields[name] - known)) / (1.0 if name == "r" else _size(problem, known))

        return min((max(apart(*one) for one in answer.items()) for answer in self.answers), default=None)


def _size(problem: Problem, values: Array) -> float:
    """Largest value; of pressures at least NEGLIGIBLE of what the film could build up, mu U L/h^2: the answer can be p = 0."""
    size = problem.reduce.max(np.abs(values))
    if isinstance(problem, LubricationProblem):
        thinnest = problem.reduce.min(problem.scheme.h)
        size = max(size, NEGLIGIBLE * problem.mu * abs(problem.U) * problem.grid.lengths[0] / thinnest**2 / problem.p_unit)
    return size or 1.0


class References:
    """Made at first use, one for each scene and grid."""

    def __init__(self) -> None:
        self._known: dict[str, Reference] = {}

    def of(self, scene: Scene) -> Reference:
        """The reference of a film with cavitation; for other scenes one without answers. Collective."""
        key = scene.model_dump_json()
        if key not in self._known:
            self._known[key] = discrete(scene) if isinstance(scene, LubricationScene) else Reference()
        return self._known[key]


def discrete(scene: LubricationScene) -> Reference:
    """The discrete solution with a proved band around it: it is the only one, whatever method finds it. Collective.

    By the active set and, where its answer is not proved, by policy iteration. Where neither is (p = r = 0 somewhere leaves the
    band no room), their common answer, if it is one.
    """
    found: list[Fields] = []
    for method in ("active-set", "monotone"):
        with solve(scene, method=method, system="reduced", stopping=TIGHT, certify=True) as solution:
            band, problem = solution.enclosure, solution.problem
            if band is not None and band.certified:
                p_max = problem.reduce.max(solution.fields["p"]) * getattr(problem, "p_unit", 1.0)
                width = max(band.bounds["band_p"] / (p_max or 1.0), band.bounds["band_r"])
                return Reference((solution.fields,), f"{method}, proved to {width:.0e}")
            if solution.converged:
                found.append(solution.fields)
            if len(found) == 2:
                apart = Reference((found[0],)).distance(problem, found[1])
                if apart is not None and apart < 0.01 * WRONG:
                    return Reference((found[0],), f"active-set and monotone agree to {apart:.0e}")
    return Reference()
