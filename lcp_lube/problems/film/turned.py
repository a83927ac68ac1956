"""A film under a wall that moves to smaller x: the mirror image is solved, in which the wall moves to larger x.

Methods, matrices and the void's way know one direction only. What is told of the answer, fields and numbers, is turned back:
x counts as in the scene, flows are those through the scene's own sides, and fronts stay what they are in the sense of motion,
rupture being where the moving fluid leaves the full film.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ..certificate import Certificate
from ..grid import Grid
from ..solution import Fields
from ..transfer import Pick
from .exact import ExactSolution
from .lubrication import LubricationProblem
from .views import MirroredFilm


class TurnedProblem(LubricationProblem):
    """The film as it stands, for what is told of its answer; `moving` is the mirror image, which is solved.

    Parameters
    ----------
    moving : the discrete mirror image, |U| its speed. exact : the exact 1D solution of the film as it stands, where known.
    """

    def __init__(self, moving: LubricationProblem, exact: Callable[[], ExactSolution | None] | None = None):
        self.image, grid = moving, moving.grid
        ends = tuple((pair[::-1] if k == 0 else pair) for k, pair in enumerate(grid.ends))
        x, y = grid.places
        places = (None if x is None else grid.lengths[0] - x[::-1], y)
        own = Grid(grid.shape, grid.lengths, grid.petsc_comm, ends=ends, places=places, polar=grid.polar)  # type: ignore[arg-type]
        columns = np.arange(own.x_start, own.x_end)[None, :]
        lines = np.arange(own.y_start, own.y_end)[:, None]
        there, back = grid.shape[0] - 1 - columns, grid.shape[0] - 1 - np.arange(grid.x_start, grid.x_end)[None, :]
        self._here = Pick(grid, own, lines, there)
        self._there = Pick(own, grid, np.arange(grid.y_start, grid.y_end)[:, None], back)
        s = moving.scheme
        turned = {name: self._here(getattr(s, name).ravel()).reshape(own.box) for name in s.arrays}
        turned |= {"k_W": turned["k_E"], "k_E": turned["k_W"], "b_C": -turned["b_C"], "b_W": -turned["b_W"]}
        if s.storage is not None:
            turned |= {name: -turned[name] for name in ("storage", "kept")}
        # couette_E: of the face downstream, as in the mirror image.
        turned |= {"couette_W": -turned["couette_W"], "couette_E": -turned["couette_E"]}
        west, east, *ends_y = moving.p_sides
        film = moving.film.film if isinstance(moving.film, MirroredFilm) else MirroredFilm(moving.film, grid.lengths[0])
        super().__init__(
            own,
            replace(s, **turned, held=None),  # type: ignore[arg-type]
            mu=moving.mu,
            U=-moving.U,
            p_unit=moving.p_unit,
            p_sides=(east, west, *ends_y),
            p_c=moving.p_c,
            film=film,
            exact=exact,
        )
        self.more_fields = {name: (self._here(values), unit) for name, (values, unit) in moving.more_fields.items()}

    @property
    def moving(self) -> LubricationProblem:
        return self.image

    def here(self, fields: Fields) -> Fields:
        return {name: self._here(values) for name, values in fields.items()}

    def there(self, fields: Fields) -> Fields:
        return {name: self._there(values) for name, values in fields.items()}

    def flow(self, p: Array, r: Array) -> Array:
        return self._here(self.moving.flow(self._there(p), self._there(r)))

    def balance(self, p: Array, r: Array) -> Array:
        return self._here(self.moving.balance(self._there(p), self._there(r)))

    def certify(self, fields: Fields, eps1: float, closely: bool = True) -> Certificate:
        return self.moving.certify(self.there(fields), eps1, closely)

    def boundary_flows(self, p: Array, r: Array) -> tuple[float, float, float, float]:
        west, east, south, north = self.moving.boundary_flows(self._there(p), self._there(r))
        return -east, -west, south, north

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """Those of the mirror image, their places and directions turned back. Collective."""
        return self.told(self.moving.quantities(self.there(fields)))

    def told(self, of_image: dict[str, Any]) -> dict[str, Any]:
        """What is told of the mirror image as it is told of the film as it stands."""
        out, L = dict(of_image), self.grid.lengths[0]
        for name in ("p_max_at", "min_h_at"):
            out[name] = [L - out[name][0], *out[name][1:]] if out[name] is not None else None
        for name in ("rupture", "reformation"):
            out[name] = L - out[name] if out[name] is not None else None
        for name in ("ruptures", "reformations"):
            out[name] = sorted(L - x for x in out[name])
        out["flow"] = {**out["flow"], "west": out["flow"]["east"], "east": out["flow"]["west"]}
        out["friction"] = -out["friction"]
        return out

    def destroy(self) -> None:
        """Free the PETSc objects of both."""
        self._here.destroy()
        self._there.destroy()
        super().destroy()
        self.moving.destroy()
