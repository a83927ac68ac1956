"""What several tests need: films from random numbers, scenes with any film, matrices as NumPy arrays."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st
from petsc4py import PETSc
from pydantic import PrivateAttr

from lcp_lube.problems.film.exact import ExactSolution, exact_solution
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.problems.film.reynolds import box_scheme
from lcp_lube.problems.film.shapes import Along, Sum
from lcp_lube.problems.grid import Grid
from lcp_lube.scenes.published import LubricationScene

CD, DC = "convergent-divergent", "divergent-convergent"
WAVES = ("sinusoid", "parabola")
L, WIDTH, MU, U = 0.1, 0.07, 0.015, 5.0


@dataclass(frozen=True)
class Knots:
    """Film through random heights at equidistant knots along x, and tilted along y."""

    heights: tuple[float, ...]  # m
    tilt: float = 0.0  # relative rise from y = 0 to y = WIDTH

    def __call__(self, x: Any, y: Any = 0.0, /) -> np.ndarray:
        knots = np.linspace(0, L, len(self.heights))
        return np.interp(x, knots, self.heights) * (1 + self.tilt * np.asarray(y) / WIDTH)


@dataclass(frozen=True)
class Wave:
    """The film of a slider: one wave between start and start + length."""

    shape: str
    form: str
    h_min: float
    h_max: float
    start: float
    length: float

    @property
    def film(self) -> Sum:
        heights = (self.h_min, self.h_max) if self.form == CD else (self.h_max, self.h_min)
        return Sum([Along(self.shape, *heights, self.start, self.start + self.length)])

    def __call__(self, x: Any, y: Any = None, /) -> np.ndarray:
        return self.film(x, y)

    def breakpoints(self) -> tuple[float, ...]:
        return self.film.breakpoints()


class FilmScene(LubricationScene):
    """A scene with any film at all: `FilmScene.of(film, p_a=1e6, ...)`."""

    _film: Any = PrivateAttr()

    @classmethod
    def of(cls, film: Any, **data: Any) -> "FilmScene":
        scene = cls(**data)
        scene._film = film
        return scene

    @property
    def gap(self) -> Any:
        return self._film


@dataclass(frozen=True)
class Pieces:
    """A film between knots at any places: straight, smooth (half a cosine from knot to knot) or in steps."""

    kind: str
    knots: tuple[float, ...]  # m, from 0 to L
    heights: tuple[float, ...]  # m

    def __call__(self, x: Any, y: Any = 0.0, /) -> np.ndarray:
        x = np.broadcast_arrays(np.asarray(x, dtype=float), y)[0]
        k = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, len(self.knots) - 2)
        knots, h = np.array(self.knots), np.array(self.heights)
        t = np.clip((x - knots[k]) / (knots[k + 1] - knots[k]), 0, 1)
        part = {"straight": t, "smooth": np.sin(0.5 * np.pi * t) ** 2, "steps": 0.0}[self.kind]
        return h[k] + (h[k + 1] - h[k]) * part

    def breakpoints(self) -> tuple[float, ...]:
        return self.knots


def random_films(count: int, seed: int) -> Iterator[tuple[FilmScene, ExactSolution]]:
    """Scenes with their exact solutions: film ratios up to 20, up to 6 pieces, any of three pressures at either end."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        pieces = rng.integers(2, 7)
        knots = (0.0, *np.sort(rng.uniform(0.03, 0.97, pieces - 1)) * L, L)
        kind = ("straight", "smooth", "steps")[k % 3]
        heights = 5e-6 * rng.uniform(1.5, 6 if kind == "steps" else 20) ** rng.uniform(0, 1, pieces + 1)
        film = Pieces(kind, knots, tuple(heights))
        p_a, p_b = (float(p) for p in rng.choice([0.0, 1e5, 3e6], 2))
        scheme = str(rng.choice(["face", "nodal"]))
        scene = FilmScene.of(film, p_a=p_a, p_b=p_b, scheme=scheme, name=f"{kind}{k}")
        yield scene, exact_solution(film, L, MU, U, p_a, p_b)


def knots(ratio: float = 20.0) -> st.SearchStrategy[Knots]:
    """Films between 5 and 5 ratio micrometres."""
    heights = st.lists(st.floats(0, 1), min_size=1, max_size=9).map(lambda s: tuple(5e-6 * ratio**t for t in s))
    return st.builds(Knots, heights, st.floats(0, 3))


shapes = st.one_of(st.tuples(st.integers(1, 12)), st.tuples(st.integers(1, 5), st.integers(1, 4)))
schemes = st.sampled_from(("nodal", "face", "upwind"))
pressures = st.tuples(*[st.sampled_from([0.0, 1e5, 3e6])] * 4)  # Pa, at the four sides


def make_problem(
    shape: tuple[int, ...],
    film: Any,
    scheme: str = "nodal",
    p_sides: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    p_unit: float = 1e6,
    p_c: float = 0.0,
    comm: PETSc.Comm | None = None,
) -> LubricationProblem:
    """A small problem on [0, L] or [0, L] x [0, WIDTH]."""
    grid = Grid(shape, (L, WIDTH)[: len(shape)], comm)
    box = box_scheme(grid, film, mu=MU, U=U, scheme=scheme, p_sides=p_sides, p_unit=p_unit)
    return LubricationProblem(grid, box, mu=MU, U=U, p_unit=p_unit, p_sides=p_sides, p_c=p_c, film=film)


def dense(mat: PETSc.Mat) -> np.ndarray:
    """The entries of a matrix on one rank."""
    full = mat.convert("dense", PETSc.Mat())
    out = full.getDenseArray().copy()
    full.destroy()
    return out
