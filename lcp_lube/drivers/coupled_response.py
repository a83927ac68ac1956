"""How the force of a film with effects answers to small motions of its walls: the whole coupled system, linearised.

Unknowns are z, p in the full film and -r in the cavity, and the effects' fields x (`loop`). With H(z, x, e) what flows out of
the cells, Q what they hold, and X what the effects make of an answer, a motion e exp(i nu t) gives

    H_z z' + H_x x' + i nu (Q_z z' + Q_x x') = -H_e - i nu Q_e,      x' - X_z z' - X_x x' = X_e

Effects follow at once: walls give way and oil shears, thickens and warms as in a steady film at each moment (heat that the oil
itself stores is left out, as are the walls' own). All derivatives are differences along a direction; GMRES solves, with the
film's own Jacobian at fixed coefficients for a preconditioner.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..errors import InputError
from ..problems.film.cavity import cavity_sign
from ..problems.film.contact import areas
from ..problems.film.effects import Answer, answer, factors
from ..problems.film.flows import point_weights
from ..problems.film.grooves import GroovedProblem
from ..problems.solution import Solution
from .ask import Ask
from .linearised import Linear
from .loop import Loop

STEP = 1e-4  # of differences: their error is its square
RTOL, RESTART, MOST = 1e-8, 150, 1500


class CoupledResponse:
    """A scene with effects at its solution, linearised; as `response.Response` is of a film without. Collective.

    Parameters
    ----------
    gaps : the film for each motion, by its coordinate e.

    Raises
    ------
    InputError : supplies whose pressures would follow.
    """

    def __init__(self, scene: Any, solution: Solution, gaps: Sequence[Any]):
        problem: Any = solution.problem
        grid, comm = problem.grid, problem.grid.petsc_comm
        if problem.held is not None and any(one.open for one in problem.held.supplies):
            raise InputError(f"scene {scene.name}: coefficients with effects are of supplies at given pressures")
        self.loop = loop = Loop(scene.with_shape(grid.shape), Ask(comm=comm), None)  # type: ignore[arg-type]
        base, self.p, self.r = loop.base, solution.fields["p"], solution.fields["r"]
        self.n, self.unit = grid.local_size, base.scheme.flow_unit
        columns = np.logical_or.reduce(base.columns) if isinstance(base, GroovedProblem) else np.zeros(self.n, dtype=bool)
        held = problem.held.mask.ravel() if problem.held is not None else False
        self.columns, self.given = columns, columns | held
        self.cavity = (cavity_sign(problem.reduce, self.p, self.r) < 0) & ~self.given
        self.x = loop.vector(problem.cells) if loop.names else np.zeros(0)
        self.p_max = base.reduce.max(np.abs(self.p)) or 1.0
        at = self._answer(np.zeros(self.n), self.x, base)
        self._size = 2.0 * grid.spacing[0] / self.unit * point_weights(grid)
        self._linear = Linear(at.problem, self.cavity, given=columns if columns.any() else None)
        self._areas = areas(base).ravel()
        weight = grid.cell * base.p_unit * point_weights(grid) * np.where(self.cavity, 0.0, 1.0)
        self._forward, self._sides, self._contacts = [], [], []
        model, h = loop.frozen.constant, base.scheme.h.ravel()
        for gap in gaps:
            e = STEP * base.reduce.min(h)
            change = self._change(gap, e)
            e /= base.reduce.max(np.abs(change)) or 1.0
            change = self._change(gap, e)
            pair = [replace(model, gap=gap(k * e)).build(grid.shape, comm, grid) for k in (1.0, -1.0)]
            (a, qa), (b, qb) = (self._system(np.zeros(self.n), self.x, other) for other in pair)
            self._forward.append(((a - b) / (2.0 * e), (qa - qb) / (2.0 * e)))
            self._sides.append(weight * change)
            self._contacts.append(base.p_unit * self._areas * change)
            for other in pair:
                other.destroy()

    def _change(self, gap: Any, e: float) -> Array:
        """dh/de at the points."""
        grid = self.loop.base.grid
        rise = (gap(e)(grid.x, grid.y) - gap(-e)(grid.x, grid.y)) / (2.0 * e)
        return np.broadcast_to(rise, grid.box).ravel()

    def _answer(self, z: Array, x: Array, base: Any) -> Answer:
        loop, cells = self.loop, self.loop.cells(x) if self.loop.names else {}
        at_sides = [float(loop.law.density(np.array(p))) for p in loop.p_sides] if loop.law.dowson_higginson else None
        by = factors(base, cells, at_sides)
        p = (self.p + np.where(self.cavity, 0.0, z)) * base.p_unit
        return answer(base, loop.law, cells, by, p, self.r - np.where(self.cavity, z, 0.0), loop.p_sides)

    def _system(self, z: Array, x: Array, base: Any) -> tuple[Array, Array]:
        """H and x - X, one behind the other, and Q of a state."""
        at = self._answer(z, x, base)
        film = at.problem
        H = film.balance(at.p / film.p_unit, at.r) * (film.scheme.flow_unit / self.unit)
        Q = self._size * at.cells.get("density", 1.0) * film.scheme.h.ravel() * (1.0 - at.r)
        self.loop.answer = at
        made = x - self.loop.vector(self.loop.made()) if self.loop.names else x
        return np.concatenate([np.where(self.columns, z, H), made]), np.where(self.given, 0.0, Q)

    def _along(self, y: Array) -> tuple[Array, Array]:
        """What a direction (z', x') changes of both."""
        z, x = y[: self.n], y[self.n :]
        by_size = np.where(self.cavity, 1.0, 1.0 / self.p_max) * z
        size = self.loop.base.reduce.max(np.abs(np.concatenate([by_size, x])))
        if not size > 0.0:
            return np.zeros_like(y), np.zeros(self.n)
        t = STEP / size
        (a, qa), (b, qb) = (self._system(k * t * z, self.x + k * t * x, self.loop.base) for k in (1.0, -1.0))
        return (a - b) / (2.0 * t), (qa - qb) / (2.0 * t)

    def _solve(self, b: Array, nu: float, stored: bool = True) -> Any:
        """Complex (z', x') of a complex right-hand side; at nu = 0 both are real. Collective."""
        size, n, parts = b.size, self.n, (b.real,) if nu == 0.0 else (b.real, b.imag)
        comm = self.loop.base.grid.petsc_comm

        class Whole:
            def mult(shell, mat: PETSc.Mat, v: PETSc.Vec, out: PETSc.Vec) -> None:
                found = [self._along(y) for y in v.array_r.reshape(len(parts), size)]
                whole = np.array([one for one, _ in found])
                if nu:
                    whole[0, :n] -= nu * stored * found[1][1]
                    whole[1, :n] += nu * stored * found[0][1]
                out.setArray(whole.ravel())

        class Film:
            def apply(shell, pc: PETSc.PC, v: PETSc.Vec, out: PETSc.Vec) -> None:
                done = v.array_r.reshape(len(parts), size).copy()
                for y in done:
                    y[:n] = self._linear.solve(y[:n])
                out.setArray(done.ravel())

        sizes = (len(parts) * size, None)
        mat = PETSc.Mat().createPython((sizes, sizes), Whole(), comm=comm)
        mat.setUp()
        ksp = PETSc.KSP().create(comm)
        ksp.setOptionsPrefix("coupled_response_")
        ksp.setOperators(mat)
        ksp.setType("gmres")
        ksp.setGMRESRestart(RESTART)
        ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=MOST)
        pc = ksp.getPC()
        pc.setType("python")
        pc.setPythonContext(Film())
        ksp.setFromOptions()
        v, rhs = mat.createVecs()
        rhs.setArray(np.concatenate(parts))
        ksp.solve(rhs, v)
        found, reason = v.array_r.reshape(len(parts), size).copy(), ksp.getConvergedReason()
        for obj in (v, rhs, ksp, mat):
            obj.destroy()
        if reason < 0:
            raise InputError(f"scene {self.loop.scene.name}: coefficients: the linearised effects were not solved ({reason})")
        return found[0] if nu == 0.0 else found[0] + 1j * found[1]

    @cached_property
    def _slow(self) -> list[Array]:
        """What stiffness and damping are both made of."""
        return [self._solve(-H_e, 0.0) for H_e, _ in self._forward]

    def stiffness(self) -> Array:
        """-dF/de with nothing but e changed, shape (motions, motions)."""
        return self._forces(self._slow).real

    def damping(self) -> Array:
        """-dF/d(de/dt) in the limit of slow motion."""
        found = []
        for (_, Q_e), y in zip(self._forward, self._slow, strict=True):
            rhs = np.zeros_like(y)
            rhs[: self.n] = -(Q_e + self._along(y)[1])
            found.append(self._solve(rhs, 0.0))
        return self._forces(found).real

    def at(self, nu: float, stored: bool = True) -> Any:
        """K + i nu C at this frequency, rad/s > 0; stored = False: as if nothing were stored but what the walls displace."""
        found = []
        for H_e, Q_e in self._forward:
            rhs = -H_e.astype(complex)
            rhs[: self.n] -= 1j * nu * Q_e
            found.append(self._solve(rhs, nu, stored))
        return self._forces(found)

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
