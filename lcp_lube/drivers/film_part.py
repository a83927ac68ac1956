"""Films: what does not vary is not solved for, what mirrors itself about the middle of the width is solved once.

In the order in which they are looked for:

constant : the pressure is the same at every open side, and the film is everywhere the same, or the wall at rest: that pressure
    is the answer.
unpressed : no side has a pressure, and the film is nowhere narrower than where its oil comes in: there is none inside either,
    and the void is what flow is missing.
line : film and sides do not depend on y (both sides along the flow closed or periodic): one line is solved in 1D.
mirror : the film is symmetric about the middle of the width, and the sides south and north are alike: half the width is solved,
    with a closed side in the middle. For an odd number of lines the middle one lies on that side and has half cells.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.parallel import Array
from ..problems.facts import Facts
from ..problems.film.cavity import missing_flow
from ..problems.film.edges import jumps_of
from ..problems.film.halves import Lent, half
from ..problems.film.lines import some_places
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model, Side
from ..problems.film.supplies import pressed
from ..problems.grid import EVEN, Grid
from ..problems.solution import Fields, Problem
from ..problems.strips import STRIP
from ..problems.transfer import numbers
from ..scenes.moving import film_of
from ..scenes.scene import Derived, Solvable

SAME = 1e-12  # relative difference that coordinates' rounding leaves between two values of one film
CUBED = 1000.0  # the same of conductances, in multiples of SAME; where rims cut faces they were found to differ by 50
SAMPLE = (65, 5)  # columns and lines that are compared first, before anything is built

SENTENCES = {
    "constant": "nothing to solve: the pressure is the same at every side, and nothing else moves the fluid",
    "unpressed": "nothing to solve: the film is nowhere narrower than where its oil comes in, and needs no pressure",
    "line": "solved in 1D: neither the film nor the sides depend on y",
    "mirror": "half the width is solved: the film and the sides are symmetric about its middle",
}
UNLIKELY = "neither film nor sides have a symmetry"
NONE = "film and sides do not share a symmetry"


def applies(scene: Solvable) -> bool:
    """Whether there is something that symmetries could be looked for in: a film."""
    return model_of(scene) is not None and not isinstance(scene, Part)


def model_of(scene: Solvable) -> Model | None:
    """The film behind a scene, where it is one of a fluid with constant viscosity and density."""
    model = film_of(scene)
    return model if model is not None and model.law is None and not model.effects else None


@dataclass(frozen=True)
class Part(Derived):
    """What is left of a scene.

    kind : a key of SENTENCES. shape : that of the whole scene's grid, in 1D for 'line'.
    problem : the whole scene's, if it has been built.
    """

    kind: str
    problem: LubricationProblem | None = None

    @property
    def sentence(self) -> str:
        return SENTENCES[self.kind]

    def with_shape(self, shape: tuple[int, ...]) -> "Part":
        return Part(self.whole.with_shape(shape), self.kind)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.whole.shape[:1] if self.kind == "line" else self.whole.shape

    @cached_property
    def own(self) -> tuple[Model, tuple[int, ...]]:
        """The part's own film, and its grid."""
        model = model_of(self.whole)
        assert model is not None  # as `applies` found
        if self.problem is not None:
            x, y = self.problem.grid.places
        else:
            x, y = model.lines(self.whole.shape) if len(self.whole.shape) == 2 else EVEN
        if self.kind == "line":
            return replace(model, lengths=model.lengths[:1], exact=None, places=(x, None), integrals=False), self.shape
        nx, ny = self.shape
        y = None if y is None else y[: (ny + 1) // 2]
        west, east, south, _ = model.sides
        south = south if south.kind == "open" else Side("closed")
        sides = (west, east, south, Side("mirror" if ny % 2 else "closed"))
        lengths = (model.lengths[0], 0.5 * model.lengths[1])
        supplies = tuple(one.half for one in model.supplies)
        return replace(model, lengths=lengths, sides=sides, supplies=supplies, exact=None, places=(x, y)), (nx, (ny + 1) // 2)

    @cached_property
    def lent(self) -> Lent:
        """Half of the whole's coefficients, in its memory, if they are all here."""
        whole = self.problem
        if self.kind != "mirror" or whole is None or not whole.plain or whole.grid.comm.size > 1:
            return Lent()
        return half(whole.scheme, self.own[1][1], self.shape[1] % 2 == 1, whole.grid.periodic[1])

    def grid(self, comm: PETSc.Comm | None = None) -> Grid:
        """The part's points."""
        model, shape = self.own
        return model.grid(shape, comm)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        model, shape = self.own
        return replace(model.facts(shape, comm), spread=prod(self.whole.shape), lent=self.lent.scheme is not None)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The discrete problem of the part. Collective."""
        model, shape = self.own
        if self.problem is not None and self.lent.scheme is not None:
            self.lent.take()
            held = self.problem.held
            held = held and replace(held, supplies=model.supplies, owner=held.owner[: shape[1]])
            return model.build(shape, comm, made=(pressed(self.lent.scheme, held, self.problem.p_unit), held))
        problem = model.build(shape, comm)
        return self.factored(problem, *numbers(problem.grid))

    def answer(self, problem: Problem) -> Fields | None:
        """The whole problem's fields, where there is nothing to solve."""
        if self.kind not in ("constant", "unpressed"):
            return None
        model = model_of(self.whole)
        assert model is not None and isinstance(problem, LubricationProblem)  # as `part_of` found
        if self.kind == "unpressed":
            missing = missing_flow(problem.scheme.c)
            assert missing is not None  # as `part_of` found
            return {"p": np.zeros(missing.size), "r": np.abs(missing / problem.scheme.b_C).ravel()}
        p = next(side.p for side in model.sides if side.kind == "open") / problem.p_unit
        n = problem.grid.local_size
        return {"p": np.full(n, p), "r": np.zeros(n)}

    def places(self, grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Line and column in the part that the owned points of the whole grid are like."""
        j, i = numbers(grid)
        return (0 * j if self.kind == "line" else np.minimum(j, grid.shape[1] - 1 - j)), i


def promising(scene: Solvable) -> bool:
    """Whether some columns and lines of the film look like one of a part: nothing is built for films that do not."""
    model = model_of(scene)
    assert model is not None  # as `applies` found
    supplied = model.supplies
    if model.polar is not None:  # arcs differ from line to line
        return False
    if supplied and (len(scene.shape) == 1 or not all(one.region.symmetric(0.5 * model.lengths[-1]) for one in supplied)):
        return False
    if _at_rest(model):
        return True
    if model.stored is not None and len(model.lengths) == 1:
        return False
    south, north = model.sides[2:4]
    if len(scene.shape) == 2 and south != north and len(_given_pressures(model)) > 1 and "open" in (south.kind, north.kind):
        return False
    kinds = [tuple(side.kind for side in model.sides[k : k + 2]) for k in (0, 2)]
    xs, *ys = (some_places(*side) for side in zip(scene.shape, model.lengths, kinds, SAMPLE, strict=False))
    y = ys[0][:, None] if ys else np.zeros((1, 1))
    with np.errstate(all="ignore"):  # a film that is not positive is reported where it is built
        h = np.broadcast_to(model.film(xs[None, :], y), (y.size, xs.size))
        if _dragged_alone(model) and np.all(h >= h[:, :1] * (1.0 - SAME)):
            return True
        if not ys:
            return bool(np.ptp(h) <= SAME * h.max())
        mirrored = model.film(xs[None, :], model.lengths[-1] - y)
        return bool(np.all(np.abs(h / h[:1] - 1.0) <= SAME) or np.all(np.abs(mirrored / h - 1.0) <= SAME))


def _given_pressures(model: Model) -> set[float]:
    """Those of the open sides."""
    return {side.p for side in model.sides[: 2 * len(model.lengths)] if side.kind == "open"}


def _dragged_alone(model: Model) -> bool:
    """Whether nothing but the wall moves the oil, from one side to the other."""
    moved = any(_given_pressures(model)) or model.supplies or model.stored is not None
    return not (moved or model.sides[0].kind == "periodic")


def _at_rest(model: Model) -> bool:
    """Whether neither the wall, nor its motion, nor a difference of pressures moves the fluid."""
    return not model.U and not model.supplies and model.stored is None and len(_given_pressures(model)) == 1


def part_of(scene: Solvable, problem: Problem) -> Part | None:
    """The least part of a scene that gives its whole answer; None where that is the scene itself. Collective."""
    model = model_of(scene)
    if model is None or not isinstance(problem, LubricationProblem):
        return None
    grid = problem.grid
    west, east, *ends = model.sides
    if _at_rest(model):
        return Part(scene, "constant")
    rims = model.cut or model.dry is not None  # faces see round edges that no point or middle of a face may lie in
    still = model.stored is None and not model.supplies and not west.r and "closed" not in (west.kind, east.kind) and not rims
    if len(_given_pressures(model)) == 1 and still and _is_constant(problem):
        return Part(scene, "constant")
    if _dragged_alone(model) and _needs_no_pressure(problem):
        return Part(scene, "unpressed")
    if grid.dim == 1:
        return None
    if "open" not in (ends[0].kind, ends[1].kind) and not model.supplies and not rims and _all_lines_are_one(problem):
        return Part(scene, "line", problem)
    faces = not (model.mean_cubes and model.scheme == "upwind")  # whether the discretisation asks for the film there
    if ends[0] == ends[1] and grid.shape[1] // 2 >= grid.comm.size and _is_symmetric(problem, faces):
        return Part(scene, "mirror", problem)
    return None


def _is_constant(problem: LubricationProblem) -> bool:
    """Whether all points and faces have one film thickness. Collective."""
    if jumps_of(problem.film, "x") or jumps_of(problem.film, "y"):
        return False  # between points, where no one looks
    h, largest = problem.scheme.h, problem.reduce.max(problem.scheme.h)
    return _all_close(problem, [(h, largest)]) and _all_close(problem, [(faces, largest) for faces in _films(problem)])


def _needs_no_pressure(problem: LubricationProblem) -> bool:
    """Whether the wall drags all oil on that comes in, on lines that this rank has whole. Collective."""
    grid = problem.grid
    own = grid.box[1] == grid.shape[0] and missing_flow(problem.scheme.c) is not None
    return bool(grid.reduce.min(np.array([float(own)])))


def _all_lines_are_one(problem: LubricationProblem) -> bool:
    """Whether the film does not depend on y. Collective."""
    if jumps_of(problem.film, "y"):
        return False
    grid, film = problem.grid, problem.film
    x_nodes, x_faces = grid.nodes_and_faces(0)
    first = np.array([[grid.origin[1]]])
    if not _all_close(problem, [(problem.scheme.h, film(grid.x, first))]):
        return False
    lines = [film(x[None, :], first) for x in (x_nodes, x_faces, x_nodes)]
    return _all_close(problem, list(zip(_films(problem), lines, strict=True)))


def _is_symmetric(problem: LubricationProblem, faces: bool) -> bool:
    """Whether h(x, y) = h(x, width - y), at the points, and on the faces too. Collective."""
    grid = problem.grid
    mirror, y = 2 * grid.origin[1] + grid.lengths[1], grid.lines[1]
    if not np.allclose(y, mirror - y[::-1], rtol=0.0, atol=SAME * grid.lengths[1]):
        return False
    edges = np.unique(jumps_of(problem.film, "y"))
    if not np.allclose(edges, np.sort(mirror - edges), rtol=0.0, atol=SAME * grid.lengths[1]):
        return False
    some = np.unique(np.linspace(0, grid.box[0] - 1, SAMPLE[1]).round().astype(int))  # enough to rule out most films
    if not _all_close(problem, [(problem.scheme.h[some], problem.film(grid.x, mirror - grid.y[some]))]):
        return False
    if grid.comm.size == 1:  # what is solved is all here
        s, middle = problem.scheme, grid.box[0] // 2  # k_E and couette_E are k_W and couette_W but for the last ones
        differ = [a for a in (s.k_W, s.k_E[:, -1:], s.couette_W, s.couette_E[:, -1:], s.h) if a.strides[0]]  # from line to line
        pairs = [(s.k_S, s.k_N), *zip(differ, differ, strict=True)]
        return _all_close(problem, [(a[:middle], b[::-1][:middle]) for a, b in pairs], CUBED * SAME)
    pairs = list(zip(_films(problem), _films(problem, mirror), strict=True))
    if (by := problem.factors) is not None:  # of effects
        j, i = numbers(grid)
        other = by.on(grid, grid.shape[1] - 1 - j, i).values
        other = other | {"k_S": other["k_N"], "k_N": other["k_S"]}
        if not _all_close(problem, [(values, other[name]) for name, values in by.values.items()], CUBED * SAME):
            return False
    return _all_close(problem, pairs if faces else pairs[:1])


def _films(problem: LubricationProblem, mirror: float | None = None) -> list[Array]:
    """The film at the points, x faces and y faces, or at y = mirror - theirs."""
    grid, film = problem.grid, problem.film
    x_nodes, x_faces = grid.nodes_and_faces(0)
    y_nodes, y_faces = grid.nodes_and_faces(1) if grid.dim == 2 else (np.zeros(1), np.zeros(0))
    lines = [line if mirror is None else mirror - line for line in (y_nodes, y_nodes, y_faces)]
    return [film(x[None, :], y[:, None]) for x, y in zip((x_nodes, x_faces, x_nodes), lines, strict=True)]


def _all_close(problem: LubricationProblem, pairs: list[tuple[Array, Any]], tol: float = SAME) -> bool:
    """Whether a = b to the last digits, looked at in strips, up to the first in which they differ. Collective."""
    worst = 0.0
    for a, b in pairs:
        lines, b = max(1, STRIP // a.shape[1]), np.broadcast_to(b, a.shape)
        for j in range(0, a.shape[0], lines):
            own, other = a[j : j + lines], b[j : j + lines]
            if np.array_equal(own, other):  # as those of films that are the same along y are
                continue
            worst = max(worst, float(np.max(np.abs(own - other) > tol * np.abs(other))))
            if worst:
                break
    return bool(problem.reduce.max(np.array([worst])) == 0.0)
