"""The loop of `coupling`: a film with its coefficients held, and Anderson's method for the fields that these come from."""

from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..errors import InputError
from ..problems.facts import Facts
from ..problems.film.effects import Answer, Cells, Compressible, Effect, FaceFactors, answer, factors, neutral
from ..problems.film.fluid import Law
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.solution import Solution
from ..scenes.scene import Derived, Solvable
from .ask import Ask, Start
from .chain import added
from .compose import Inner

MOST_SOLVES = 100
SETTLED = 0.1  # of eps1: relative change of the coefficients at which they count as found
MEMORY = 30  # answers that Anderson's method combines; -coupling_snes_anderson_m changes it
CYCLE = 25  # steps after which it begins anew: its least squares see no changes 1e-8 of the largest that they remember
LONGEST = 1.0  # relative change of a coefficient in one step, before answers are combined
LEAST_LIFT = -0.9  # of the rigid film, of an iterate
STEEPEST = 0.9  # of q, over 1/b, where the pressure is without bound: of an iterate, whose viscosity is then 10 times mu
WIDEST = 40.0  # of the logarithm of a viscosity over mu, of an iterate


@dataclass(frozen=True)
class Frozen(Derived):
    """A scene with its coefficients held, in q where Barus' law holds. by : factors of its own grid; None: no effects."""

    law: Law
    by: FaceFactors | None = None
    even: bool = True

    @property
    def constant(self) -> Model:
        """The rigid film of the constant fluid, in q."""
        model: Model = self.whole.model
        sides = (replace(side, p=float(self.law.reduced(np.array(side.p)))) for side in model.sides)
        supplies = tuple(replace(one, p=float(self.law.reduced(np.array(one.p)))) for one in model.supplies)
        changed = {"sides": tuple(sides), "supplies": supplies, "law": None, "effects": (), "exact": None}
        return replace(model, **changed)  # type: ignore[arg-type]

    @property
    def model(self) -> Model | None:
        """What `grooves` and `symmetry` look at; they take their parts' factors from `by`."""
        return self.constant if self.even or self.constant.grooves else None

    def with_shape(self, shape: tuple[int, ...]) -> "Frozen":
        return Frozen(self.whole.with_shape(shape), self.law, None, self.even)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.constant.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = self.constant.build(self.shape, comm)
        problem.coefficients_for = None  # what is certified is another problem, made from this one
        return problem if self.by is None else self.by.film(problem)


class Loop:
    """G, and what its evaluations leave behind. Every method is collective."""

    def __init__(self, scene: Solvable, ask: Ask, inner: Inner):
        self.scene, self.ask, self.inner = scene, ask, inner
        self.model: Model = scene.model  # type: ignore[attr-defined]
        self.law = self.model.law or Law()
        more = (Compressible(self.law),) if self.law.dowson_higginson else ()
        self.effects: tuple[Effect, ...] = (*more, *self.model.effects)
        moving = {"density", "lift", "drag_flow"} & {name for effect in self.effects for name in effect.channels}
        if moving and self.model.scheme != "face":
            what = "fluid.density = dowson-higginson" if moving == {"density"} else f"an effect on {', '.join(sorted(moving))}"
            raise InputError(f"{scene.name}: scheme = {self.model.scheme}: {what} needs scheme = face")
        self.frozen = Frozen(scene, self.law, None, all(effect.even for effect in self.effects))
        self.base = self.frozen.build(ask.comm)
        self.p_sides = tuple(side.p if side.kind == "open" else 0.0 for side in self.model.sides)
        self.h = self.base.scheme.h.ravel()
        self.names = list(neutral(self.effects, 0))
        self.solution: Solution | None = None  # the last one
        self.first: Solution | None = None
        self.steps: list = []
        self.times: dict[str, float] = {}
        self.rescued: Solution | None = None
        self.solves, self.work, self.change = 0, 0, np.inf
        self.answer: Answer | None = None
        self.beyond = False  # whether no pressure carries the last film's flow
        self.start: Solution | Start | None = ask.start

    def vector(self, cells: Cells) -> Array:
        """Fields as one vector, in which equal steps are equal relative changes of coefficients."""
        parts = {"viscosity": np.log, "lift": lambda a: a / self.h}
        return np.concatenate([parts.get(name, lambda a: a)(cells[name]) for name in self.names])  # type: ignore[operator]

    def cells(self, x: Array) -> Cells:
        """The other way round; what no film can have is cut."""
        found = dict(zip(self.names, np.split(x, len(self.names)), strict=True))
        if "viscosity" in found:
            found["viscosity"] = np.exp(np.clip(found["viscosity"], -WIDEST, WIDEST))
        if "lift" in found:
            found["lift"] = self.h * np.maximum(found["lift"], LEAST_LIFT)
        return found

    def film(self, cells: Cells) -> bool:
        """Solve the film with these coefficients; whether it has an answer, which is then `answer`."""
        at_sides = [float(self.law.density(np.array(p))) for p in self.p_sides] if self.law.dowson_higginson else None
        by = factors(self.base, cells, at_sides)
        ask = replace(self.ask, start=self.start)
        if self.solves:
            ask = replace(ask, nested=None)
        new = self.inner(replace(self.frozen, by=by if cells else None), ask)
        if self.solution is not None:
            self.solution.destroy()
        self.solution = self.start = new
        self.first = self.first or new
        self.steps += new.steps
        self.rescued = new if new.took_over else self.rescued
        self.times = added(self.times, new.times)
        self.solves += 1
        self.work += new.problem.unknowns
        if not new.converged:
            return False
        unit = new.problem.p_unit  # type: ignore[attr-defined]
        q, b = new.fields["p"] * unit, self.law.barus
        self.beyond = bool(b) and not self.base.reduce.max(b * q) < 1.0
        if self.beyond and "viscosity" in self.names:  # of an iterate: hotter oil may carry what this one cannot
            q = np.minimum(q, STEEPEST / b)
        p = self.law.pressure(q)
        with np.errstate(all="ignore"):
            self.answer = answer(self.base, self.law, cells, by, p, new.fields["r"], self.p_sides)
        return bool(np.isfinite(self.base.reduce.max(p)))

    def made(self) -> Cells:
        """The fields that the effects make of the last answer."""
        assert self.answer is not None
        out = neutral(self.effects, self.h.size)
        for effect in self.effects:
            effect.apply(self.answer, out)
        return out

    def settle(self, cells: Cells, tol: float) -> None:
        """Anderson's method from these fields on, until they change by no more than `tol` or no film can be solved."""
        comm = self.base.grid.dm.comm
        x = PETSc.Vec().createMPI((len(self.names) * self.h.size, None), comm=comm)
        x.setArray(self.vector(cells))
        snes = PETSc.SNES().create(comm)
        snes.setOptionsPrefix("coupling_")
        snes.setType("anderson")
        snes.setTolerances(max_it=CYCLE)

        def residual(snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
            before = x.array_r.copy()
            if self.film(self.cells(before)):
                with np.errstate(all="ignore"):
                    after = before - self.vector(self.made())
            else:
                after = np.full_like(before, np.nan)  # ends the iteration
            self.change = self.base.reduce.max(np.abs(after))
            f.setArray(np.clip(after, -LONGEST, LONGEST))

        def ended(snes: PETSc.SNES, it: int, norms: tuple[float, float, float]) -> int:
            if not np.isfinite(self.change):
                return int(PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN)
            return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_ABS) if self.change <= tol else 0

        f = x.duplicate()
        snes.setFunction(residual, f)
        snes.setConvergenceTest(ended)
        options = PETSc.Options("coupling_")
        ours = {"snes_anderson_m": MEMORY} if not options.hasName("snes_anderson_m") else {}
        for name, value in ours.items():
            options[name] = value
        snes.setFromOptions()
        for name in ours:
            options.delValue(name)
        while self.solves < MOST_SOLVES and self.change > tol:  # NaN: no film
            snes.solve(None, x)
        for obj in (snes, f, x):
            obj.destroy()
