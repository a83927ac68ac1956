"""How the force of a film with effects answers to small motions of its walls: the whole coupled system, linearised.

Unknowns are z, p in the full film and -r in the cavity, and the effects' fields x (`loop`). With H(z, x, e) what flows out of
the cells, Q what they hold, and X what the effects make of an answer, a motion e exp(i nu t) gives

    H_z z' + H_x x' + i nu (Q_z z' + Q_x x') = -H_e - i nu Q_e,      x' - X_z z' - X_x x' = X_e

Effects follow at once: walls give way and oil shears, thickens and warms as in a steady film at each moment (heat that the oil
itself stores is left out, as are the walls' own). All derivatives are differences along a direction; GMRES solves, with the
film's own Jacobian at fixed coefficients for a preconditioner. Pressures behind restrictors follow as in `linearised.Feed`.
"""

from collections.abc import Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from ...errors import NotFound
from ...problems.film.cavity import about_to_change, cavity_sign
from ...problems.film.contact import areas
from ...problems.film.effects import Answer, answer, factors
from ...problems.film.flows import point_weights
from ...problems.film.fronts import counted
from ...problems.film.grooves import GroovedProblem
from ...problems.film.known import known_of
from ...problems.film.supplies import Supply, supply_flows
from ...problems.solution import Solution
from ..ask import Ask
from ..effects.loop import Loop
from ..supplies import Fed
from .line_forces import OfLine, carried_by, line_forces, stiffness_of
from .linearised import Linear, following
from .response import near

STEP = 1e-4  # of differences: their error is its square
OF_LINE = 0.1  # of STEP, for a line's own numbers: they have all digits, and are curved where oil thickens
RTOL, RESTART, MOST = 1e-8, 150, 1500  # of GMRES; MOST: ten restarts
Changes = tuple[Array, Array, Array]  # of a state's H and x - X, of Q, and of what supplies give and hold


class CoupledResponse(OfLine):
    """A scene with effects at its solution, linearised; as `response.Response` is of a film without. Collective.

    Parameters
    ----------
    gaps : the film for each motion, by its coordinate e. flip : points that are about to change count as changed.
    """

    rtol, most = RTOL, MOST  # of GMRES

    def __init__(self, scene: Any, solution: Solution, gaps: Sequence[Any], flip: bool = False):
        problem: Any = solution.problem
        grid, comm = problem.grid, problem.grid.petsc_comm
        self.supplies = problem.held.supplies if problem.held is not None else ()
        self.free = [k for k, one in enumerate(self.supplies) if one.open]
        scene = scene if scene.shape == grid.shape else scene.with_shape(grid.shape)  # a time step has its march's grid alone
        if self.free:
            scene = Fed(scene, tuple(Supply(one.region, one.p) for one in self.supplies))
        self.loop = loop = Loop(scene, Ask(comm=comm), None)  # type: ignore[arg-type]
        loop.base = loop.base.revised(problem.dry)
        base, self.n, self.unit = loop.base, grid.local_size, loop.base.scheme.flow_unit
        columns = np.logical_or.reduce(base.columns) if isinstance(base, GroovedProblem) else np.zeros(self.n, dtype=bool)
        held = problem.held.mask.ravel() if problem.held is not None else False
        self.columns, self.given = columns, columns | held
        self._owner = problem.held.owner.ravel() if self.free else np.zeros(0)
        self._size = 2.0 * grid.spacing[0] / self.unit * point_weights(grid)
        self._areas = areas(grid).ravel()
        self.place(solution.fields["p"], solution.fields["r"], loop.vector(problem.cells) if loop.names else np.zeros(0), flip)
        weight = grid.cell * base.p_unit * point_weights(grid)
        model, least = loop.frozen.constant, STEP * base.reduce.min(base.scheme.h.ravel())
        steps = [least / (base.reduce.max(np.abs(self._change(gap, least))) or 1.0) for gap in gaps]
        changes = [self._change(gap, e) for gap, e in zip(gaps, steps, strict=True)]
        carried = [weight * change for change in changes]
        self._sides = [carried_by(problem, self.p, self.r, self.cavity, one) for one in carried]
        touched = base.p_unit + problem.cells.get("contact", 0.0)  # dp_a by the loop's field, log(1 + p_a/p_unit)
        self._contacts = [touched * self._areas * change for change in changes]
        self._forward, forces, fronts = [], [], list[Any]()
        told = bool(gaps) and known_of(problem) is not None
        for k, (gap, e) in enumerate(zip(gaps, steps, strict=True)):
            pair = [near(model, gap(side * e), base) for side in (1.0, -1.0)]
            self._forward.append(_slopes([self._system(np.zeros(self.n), self.x, other) for other in pair], 2.0 * e))
            borne_by = [counted(other, self.p * base.p_unit, self.r) / base.p_unit for other in pair]
            fronts.append([base.reduce.dot(one, borne_by[0] - borne_by[1]) / (2.0 * e) for one in carried])
            for other in pair:
                other.destroy()
            e *= OF_LINE
            beside = [near(model, gap(side * e), base) for side in (1.0, -1.0)] if told else []
            for other in beside:
                other.oil, other.p_sides, other.held = problem.oil, problem.p_sides, problem.held  # pressures, not their q
                forces.append(line_forces(other, changes))
                other.destroy()
            steps[k] = e
        self._line, self._fronts = stiffness_of(forces, steps), -np.transpose(fronts) if fronts else 0.0

    def place(self, p: Array, r: Array, x: Array, flip: bool = False) -> None:
        """Linearise at a state: p in p_unit. Collective."""
        base, self.p, self.r, self.x = self.loop.base, p, r, x
        self.cavity = (cavity_sign(base.reduce, p, r) < 0) & ~self.given
        self.p_max = base.reduce.max(np.abs(p)) or 1.0
        self.changing = about_to_change(base.reduce, p, r) & ~self.given
        self.cavity ^= self.changing & flip
        at = self._answer(np.zeros(self.n), x, base)
        self._linear = Linear(at.problem, self.cavity, given=self.columns if self.columns.any() else None, factored=True)
        taken = supply_flows(at.problem, at.p / at.problem.p_unit, at.r)
        self._sources = np.array([one.misfit(one.p, q)[1:] for one, q in zip(self.supplies, taken, strict=True)])
        d = at.problem.scheme.diagonal.ravel() * (at.problem.scheme.flow_unit / self.unit / at.problem.p_unit)
        self._pushes = [np.concatenate([np.where(self._owner == k, d, 0.0), 0.0 * x]) for k in self.free]
        self._answers: dict[tuple[float, bool], list[Any]] = {}

    def _change(self, gap: Any, e: float) -> Array:
        """dh/de at the points."""
        grid = self.loop.base.grid
        rise = (gap(e)(grid.x, grid.y) - gap(-e)(grid.x, grid.y)) / (2.0 * e)
        return np.broadcast_to(rise, grid.box).ravel()

    def _answer(self, z: Array, x: Array, base: Any, loop: Loop | None = None) -> Answer:
        """The film of a state on `base`, the film itself or one near by; loop : of another scene, p in Pa and x the same."""
        p = (self.p + np.where(self.cavity, 0.0, z)) * self.loop.base.p_unit
        loop = loop or self.loop
        cells = loop.cells(x) if loop.names else {}
        at_sides = [float(loop.law.density(np.array(p))) for p in loop.p_sides] if loop.law.dowson_higginson else None
        by = factors(base, cells, at_sides)
        r = self.r - np.where(self.cavity, z, 0.0)
        return answer(base, loop.law, cells, by, p, r, loop.p_sides, loop.effects)

    def _system(self, z: Array, x: Array, base: Any) -> tuple[Array, Array, Array]:
        """H and x - X, one behind the other, and Q of a state; what flows out of supplies that follow, and what they hold."""
        at = self._answer(z, x, base)
        film, at.once = at.problem, True  # from the state's own T: what it leaves is nothing where that is the heat's
        H = film.balance(at.p / film.p_unit, at.r) * (film.scheme.flow_unit / self.unit)
        Q = self._size * at.cells.get("density", 1.0) * film.scheme.h.ravel() * (1.0 - at.r)
        self.loop.answer = at
        made = x - self.loop.vector(self.loop.made()) if self.loop.names else x
        fed = np.zeros((2, 0))
        if self.free:
            unit = 0.5 * self.unit * film.grid.spacing[-1] ** (film.grid.dim - 1)
            holds = [unit * film.reduce.sum(np.where(self._owner == k, Q, 0.0)) for k in self.free]
            fed = np.array([np.array(supply_flows(film, at.p / film.p_unit, at.r))[self.free], holds])
        return np.concatenate([np.where(self.columns, z, H), made]), np.where(self.given, 0.0, Q), fed

    def _along(self, y: Array) -> Changes:
        """What a direction (z', x') changes of all of them."""
        z, x = y[: self.n], y[self.n :]
        by_size = np.where(self.cavity, 1.0, 1.0 / self.p_max) * z
        size = self.loop.base.reduce.max(np.abs(np.concatenate([by_size, x])))
        if not size > 0.0:
            return np.zeros_like(y), np.zeros(self.n), np.zeros((2, len(self.free)))
        t = STEP / size
        ends, width = self._ends(t * z, t * x)
        return _slopes(ends, width * t)

    def _ends(self, z: Array, x: Array) -> tuple[list[Changes], float]:
        """Two states whose difference shows what a small step changes, and how many such steps they are apart."""
        return [self._system(k * z, self.x + k * x, self.loop.base) for k in (1.0, -1.0)], 2.0

    def _settled(self, b: Array, own: Any, nu: float, stored: bool = True, off: Any = 0.0) -> Any:
        """The answer to b with the supplies' pressures that follow; own : what b's cause makes them give by itself, m3/s;
        off : by how much it makes sources and film disagree."""
        y = self._solve(b, nu, stored)
        if not self.free:
            return y
        if (nu, stored) not in self._answers:
            self._answers[nu, stored] = [self._solve(one + 0.0j if nu else one, nu, stored) for one in self._pushes]
        answers = self._answers[nu, stored]
        slopes = np.stack([self._given(one, nu) for one in answers], axis=1)
        P = following(slopes, self._given(y, nu) + own, self._sources[self.free], off)
        return y + sum(p * one for p, one in zip(P, answers, strict=True))

    def _given(self, y: Any, nu: float) -> Any:
        """What supplies that follow give more for a change of the state."""
        flows, holds = self._along(np.ascontiguousarray(y.real))[2]
        if not nu:
            return flows
        more, hold = self._along(np.ascontiguousarray(y.imag))[2]
        return flows - nu * hold + 1j * (more + nu * holds)

    def _solve(self, b: Array, nu: float, stored: bool = True) -> Any:
        """Complex (z', x') of a complex right-hand side; at nu = 0 both are real. Collective."""
        size, n, parts = b.size, self.n, (b.real,) if nu == 0.0 else (b.real, b.imag)
        comm = self.loop.base.grid.petsc_comm

        def whole(v: Array) -> Array:
            found = [self._along(y) for y in v.reshape(len(parts), size)]
            out = np.array([one[0] for one in found])
            if nu:
                out[0, :n] -= nu * stored * found[1][1]
                out[1, :n] += nu * stored * found[0][1]
            return out.ravel()

        def film(v: Array) -> Array:
            for y in v.reshape(len(parts), size):
                y[:n] = z = self._linear.solve([y[:n]])[0]
                y[n:] -= self._along(np.concatenate([z, 0.0 * y[n:]]))[0][n:]  # what the effects make of the film's answer
            return v

        found, reason = krylov(comm, np.concatenate(parts), whole, film, self.rtol, self.most)
        if reason < 0 and self.most == MOST:
            raise NotFound(f"coefficients: the linearised effects were not solved (GMRES ended with {reason})")
        return found if nu == 0.0 else found[:size] + 1j * found[size:]

    @cached_property
    def _slow(self) -> list[Array]:
        """What stiffness and damping are both made of."""
        return [self._settled(-H_e, fed[0], 0.0) for H_e, _, fed in self._forward]

    def damping(self) -> Array:
        """-dF/d(de/dt) in the limit of slow motion."""
        found = []
        for (_, Q_e, fed), y in zip(self._forward, self._slow, strict=True):
            rhs, (_, stored, held) = np.zeros_like(y), self._along(y)
            rhs[: self.n] = -(Q_e + stored)
            found.append(self._settled(rhs, fed[1] + held[1], 0.0))
        return self._forces(found).real

    def at(self, nu: float, stored: bool = True) -> Any:
        """K + i nu C at this frequency, rad/s > 0; stored = False: as if nothing were stored but what the walls displace."""
        found = []
        for H_e, Q_e, fed in self._forward:
            rhs = -H_e.astype(complex)
            rhs[: self.n] -= 1j * nu * Q_e
            found.append(self._settled(rhs, fed[0] + 1j * nu * fed[1], nu, stored))
        return self._forces(found) + self._misplaced

    def _forces(self, found: Sequence[Any]) -> Any:
        """-F of each motion's answer, shape (motions, motions); asperities push too."""
        dot, loop, n = self.loop.base.reduce.dot, self.loop, self.n
        touching = loop.names.index("contact") + 1 if "contact" in loop.names else None

        def of(row: Array, values: Any) -> complex:
            return complex(dot(row, np.ascontiguousarray(values.real)), dot(row, np.ascontiguousarray(values.imag)))

        K = np.array([[-of(row, y[:n]) for y in found] for row in self._sides])
        if touching is not None:
            part = slice(touching * n, (touching + 1) * n)
            K -= np.array([[of(row, y[part]) for y in found] for row in self._contacts])
        return K

    def destroy(self) -> None:
        """Free the PETSc objects. Collective."""
        self._linear.destroy()
        self.loop.base.destroy()


def krylov(comm: PETSc.Comm, b: Array, whole: Any, nearly: Any, rtol: float, most: int = MOST) -> tuple[Array, int]:
    """GMRES with a linear map of arrays and one that nearly inverts it: what it finds, and how it ends. Collective."""
    mult, apply = (lambda _, v, out, of=of: out.setArray(of(v.array_r.copy())) for of in (whole, nearly))
    mat = PETSc.Mat().createPython(((b.size, None), (b.size, None)), SimpleNamespace(mult=mult), comm=comm)
    mat.setUp()
    ksp = PETSc.KSP().create(comm)
    ksp.setOptionsPrefix("coupled_response_")
    ksp.setOperators(mat)
    ksp.setType("gmres")
    ksp.setGMRESRestart(RESTART)
    ksp.setTolerances(rtol=rtol, atol=0.0, max_it=most)
    pc = ksp.getPC()
    pc.setType("python")
    pc.setPythonContext(SimpleNamespace(apply=apply))
    ksp.setFromOptions()
    v, rhs = mat.createVecs()
    rhs.setArray(b)
    ksp.solve(rhs, v)
    found, reason = v.array_r.copy(), ksp.getConvergedReason()
    for obj in (v, rhs, pc, ksp, mat):  # a PC that only Python still knew would keep what it calls
        obj.destroy()
    return found, reason


def _slopes(ends: Sequence[Changes], width: float) -> Changes:
    one, two, three = ((above - below) / width for above, below in zip(*ends, strict=True))
    return one, two, three
