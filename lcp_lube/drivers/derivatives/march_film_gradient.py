"""dQ/dh(x, y) of a march: by a film that is thicker by dh(x, y) at all times, the one that it begins with too.

Of Q - sum over n of lambda_n' G_n (`march_gradient`) each step has by its film what a steady one has (`film_gradient`), and by
its contents u = h (1 - r), which later steps have too, with f = s (1 - r):

    dQ/dh = sum over n of [ dL_n/dh + f_n (l_{n+1} lambda_{n+1} + b_{n+2} lambda_{n+2} - w_n lambda_n) ].
"""

from dataclasses import dataclass

import numpy as np

from ...base.parallel import Array
from .equations import Equations
from .film_gradient import FilmGradient, per_area
from .march_gradient import MarchGradient


@dataclass(frozen=True)
class StepAdjoint:
    """One film of a march as `FilmGradient` asks for it; parts : of the quantities, by the numbers that they are made of."""

    equations: Equations
    p: Array
    r: Array
    lambdas: dict[str, Array]
    parts: dict[str, dict[str, float]]


class MarchFilm:
    """dQ/dh of a march's quantities, as `film_gradient.FilmGradient`. Collective, as its method."""

    def __init__(self, gradient: MarchGradient):
        course, names = gradient.course, gradient.names
        self.grid, self.reported = course.grid, gradient.reported
        self.total = {name: np.zeros(self.grid.local_size) for name in names}
        for n in range(len(course.trace.steps) + 1):
            kept, size = course.kept(n), course.by_film(n)
            for name in names:
                self.total[name] += size * gradient.kept_on(name, n)
            if kept is None:
                continue
            eq, weight = course.at(n), course.formula(n).weight if n else 0.0
            at = {name: gradient.lambdas[name][n] for name in names}
            film = FilmGradient(StepAdjoint(eq, kept.p, kept.r, at, gradient.parts(n, eq)))
            for name in names:
                self.total[name] += film.lagrangian(name).ravel() - weight * size * gradient.left[name][n] / gradient.units[n]
            eq.destroy()

    def field(self, quantity: str) -> Array:
        """dQ/dh at the owned points of the solution's grid, unit of Q per m and m2 (1D: per m and m)."""
        return per_area(self.total[quantity], self.grid, self.reported)

    def destroy(self) -> None:
        """Nothing of its own."""
