"""Nonlinear multigrid: the full approximation scheme (FAS) for the flow balance in z, where a whole solve costs a few sweeps.

    G(z) = A max(z, 0) + B max(-z, 0) / -b_C - c = 0

G is an M-function, so that nonlinear Gauss-Seidel converges from any start, and what it leaves is smooth away from the fronts:
a coarser grid's business. It solves G_H(z_H) = G_H(injected z) + restricted residual, and z is corrected by the interpolated
difference. A point is not moved across its front by that: it stops there, and the sweeps decide. What the coarse grid cannot
know, where the front lies inside its cells, is put right by some more sweeps within a few cells of the front, which are few
points. Full multigrid, from the coarsest grid up, gives the start. See docs/nonlinear_multigrid.md.
"""

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.certify import filled
from ...problems.film.lubrication import LubricationProblem
from ...problems.solution import Fields, Step
from ...problems.strips import LOADED
from ...registry import ELIMINATED
from ..job import Job
from ..method_options import one_of, option
from ..newton import StalledError
from .closing import closing
from .cycles import WINDOW, CycleOptions
from .film_cycles import FilmCycles

EPS = float(np.finfo(float).eps)
TRUNCATIONS = {"none": 0, "clip": 1, "points": 2}  # see `transfer.correct`
EXACT = (1200, 5000, 10_000)  # points of the coarsest grid once the cycles have stalled, and stalled again
OWN = 17_000  # points of a problem that is then solved so itself
EXTREME = 1000.0  # film ratio above which a small ||G|| says little of p, and the corrections have to be small too
SETTLED = 1e-8  # of the largest pressure, or eps1 where that is more: what they may then be in the mean
CLOSE = 1e-6  # ||G|| below which a ring that is hardly fed is not what has stalled
FEW = 0.05  # part of a ring's line that is full, below which it is hardly fed
FED = 3e-5  # of the certificate's tolerance: the flow that a film with supplies may lose, 3e-12 in parts of what flows
SLOW, EARLY = 0.2, 0.16  # a cycle whose iterates are mixed leaves more than that; two cycles, where coarse grids mislead
VAIN = 0.5  # and two cycles, where it is corrections that are cut off at fronts
SLOWER, LEAST_FALL = 2.5, (0.1, 0.2)  # times what an F cycle leaves is what a V cycle does in its place; at least, in time too


@dataclass(frozen=True)
class FasOptions(CycleOptions):
    """As `CycleOptions`, the sweeps at fronts doubled where these are rare; truncation: of corrections at fronts, none, clip
    or points; weights: of the interpolation, by the conductances of the faces (harmonic) or the same everywhere (linear);
    rest: part that a time step may leave, where the certificate allows it, of the residual of its guess, or if that is more, of
    what the formula in time errs by."""

    truncation: str = one_of("clip", TRUNCATIONS)
    weights: str = one_of("harmonic", ("harmonic", "linear"))
    rest: float = option(0.0, lambda rest: 0 <= rest < 1, "allowed are numbers from 0, below 1")


class Fas(FilmCycles):
    """The iterates z; `newton.iterate` runs it. `norm` is that of `active_set`, ||G(z)|| / ||c||.

    The first step is full multigrid, the others are cycles; a given start takes full multigrid's place.
    """

    Options = FasOptions
    problem: LubricationProblem
    state = ("z", "norm", "_recent", "_taken", "_first", "_depth", "_truncation")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, options, start = self.problem, self.options, job.start
        # numba starts with this import, 0.4 s: only where the method is used.
        from . import coarsest, finest, following, kernels, levels, loops, mixing

        self._kernels, self._loops, self._tools, self._finest, self._coarsest = kernels, loops, levels, finest, coarsest
        problem.many = LOADED
        self._harmonic, self._truncation = options.weights == "harmonic", TRUNCATIONS[options.truncation]
        follows = start is not None and following.foreseen(problem, start["p"])
        with self.stages("assembly"):
            self._levels = levels.settled(levels.hierarchy(finest.finest(problem), self._harmonic, ELIMINATED))
        # A corrected pressure counts beside a corrected flow of void as the flow that it drives: units of pressure are any.
        first = self._levels[0]
        driven = 2.0 * max(levels.looked(first)[:2])
        self._unit = 1.0 / driven if driven > 0.0 else 1.0
        self._begin(start is not None)
        self._fields: Fields | None = None  # p and r of z as it is, where they have been asked for
        c = (filled(problem, start["p"]) if start else problem).scheme.c
        self._c_norm = problem.reduce.norm(c) if problem.held is None else self._norms()[0]
        h, self._correction, self._rest, self._share = problem.scheme.h, 0.0, self.eps1, 0.1
        # An edge of a supply may lie as near to a side as one likes: what drives the film there has no scale for the rest.
        self._extreme = problem.held is not None or problem.reduce.max(h) > EXTREME * problem.reduce.min(h)
        if start is not None:
            self.z = start["p"] + problem.scheme.b_C.ravel() * start["r"]
        self._following: Any = following.Following(problem, self._levels, self.fields) if follows else None
        plain = first.carry is None and first.held is None
        self._mixing = mixing.Mixing(first) if plain else None
        self.norm = self._first = 1.0 if follows and problem.scheme.storage is None else self._norm()  # it knows no sources
        if start is not None and problem.scheme.storage is not None and options.rest:
            lapse = problem.stored.lapse * problem.reduce.norm(problem.scheme.kept) / (self._c_norm or 1.0)  # type: ignore[arg-type]
            self._rest, self._share = max(self.eps1, min(options.rest * max(self.norm, lapse), self.eps1**0.5)), 0.5

    @property
    def z(self) -> Array:
        """p, or minus the flow of void, at this rank's points."""
        return self._own().ravel()

    @z.setter
    def z(self, value: Array) -> None:
        self._own()
        level, self._fields = self._levels[0], None
        self._finest.put(level, self.problem.grid, level.z, value)
        if level.held is not None:
            level.z[level.held] = level.given

    def _own(self) -> Array:
        self._finest.take_back(self._levels[0], self.problem, self._fields)
        return self._finest.own(self._levels[0], self.problem.grid, self._levels[0].z)

    @property
    def fields(self) -> Fields:
        if self._fields is None:
            self._fields = self._loops.pressure_and_void(self._own(), self.problem.scheme, self.problem.grid)
        return self._fields

    def _norms(self) -> tuple[float, float]:
        """||G|| and the size of its terms; before the first step of a film with supplies, what sides and supplies drive."""
        level = self._levels[0]
        self._tools.held.settle(level)
        sums = np.array(self._loops.norms(level.z, level.kx, level.ky, level.c, level.carry))
        if level.comm is not None:
            level.comm.Allreduce(sums.copy(), sums)
        return float(np.sqrt(sums[0])), float(np.sqrt(sums[1]))

    def _norm(self) -> float:
        """||G|| / ||c||; where rounding in G's sums alone exceeds eps1, on very fine grids, relative to that. Collective.

        Many small residuals of one sign are a flow that is lost. Where little flows through the sides of a film, or pressures
        drive next to nothing beside the wall, the certificate sees more of it: eps1 times that over a tenth of what may be.
        """
        residual, terms = self._norms() if self._taken or self.problem.held else (self._c_norm, self._c_norm)  # z = 0
        norm = float(residual / (max(self._c_norm, 16 * EPS * terms / self.eps1) or 1.0))
        self.certificate = None
        if not norm <= self._rest:
            return norm
        self._fields = self._fields or self._finest.give_up(self._levels, self.problem)
        seen = self.problem.certify(self.fields, self.eps1, closely=False)
        self.certificate = None if "p_error" in seen.measures else seen  # the closer look is for what is kept at last
        fed = self.problem.held is not None and self._levels[0].carry is None  # of a step `closing` leaves nothing
        lost = seen.measures["mass_defect"] / (FED if fed else self._share)
        return max(norm, self._rest * max(lost, seen.measures["residual"] / self._share) / seen.tol)

    def advance(self) -> Step:
        """Full multigrid, or one cycle; the step is what the coarse grids corrected. Collective.

        Raises
        ------
        StalledError : ||G|| has stalled.
        """
        self._own()
        anew, self._fields, level = self._taken == 0, None, self._levels[0]
        if self._stalled and self.norm > self.eps1:
            if not self._retreat():
                if not self.norm < 1.0:
                    self.z = np.zeros(self.problem.grid.local_size)  # nothing to start from (`run.Run.take_over`)
                told = f"||G|| is at {self.norm:.1e} of ||c|| after {self._taken} cycles and has stalled (fas.stall)"
                raise StalledError(told)
            anew = not self.norm < self._first
        elif self._slow and self.norm > self.eps1:
            self._retreat()
        with self.stages("cycles"):
            if self._taken == 1 and level.carry is not None:
                self._relax_fronts(level)
            known = self._taken < 2 and self._finest.unpressed(level)  # whatever it starts from
            if anew and not known:
                self._tools.right_sides(self._levels[: self._depth], self._harmonic)
                self._full_multigrid()
            elif not known:
                self._cycle(0, self._kind())
        self._count()
        with self.stages("norm"):
            if level.carry is not None or self._following:
                self._finest.renewed(level, self.problem, self._following)
                part, pressures = closing(self.problem, self.fields, self._following)
                self.z = self.z + part * np.abs(self.z)
                if pressures is not None:
                    self._following.put(pressures)
            self.norm = self._norm()
            slow = max(SLOW * self._recent[-1], self._rest) < self.norm < inf
            if slow and self._mixing and level.z.size and self._mixing.improve(self._relax_fronts):
                self.norm = self._norm()
        if not np.isfinite(self.norm):
            self.z = np.zeros(self.problem.grid.local_size)  # as above
        self._first = self.norm if self._taken == 1 else self._first
        size = float(np.sqrt(self._correction if level.comm is None else level.comm.allreduce(self._correction)))
        if self.norm <= self.eps1:
            whole = self.problem.reduce.max(self.fields["p"]) * np.sqrt(self.problem.size)
            # Where pressures drive less through a cell than the wall does, ||c|| is no scale for them.
            if whole > 0.0 and ((self._extreme and not anew) or whole < self._unit * self._c_norm):
                self.norm = max(self.norm, size / whole * min(self.eps1 / SETTLED, 1.0))
        return Step(self.norm, size, 1.0, enough=self._rest > self.eps1 and self.norm <= self._rest)

    @property
    def _slow(self) -> bool:
        """Whether coarse grids mislead, as where they do not see deep pockets, of a grid too large to be solved itself."""
        level = self._levels[0]
        return self._mixing is not None and level.nx * level.ny > OWN and self.norm > EARLY * self._recent[1]

    def _kind(self) -> str:
        """Of the next cycle: a V cycle in place of an F cycle where that will do, as the last one."""
        level, least = self._levels[0], LEAST_FALL[self._levels[0].carry is not None]
        expected = SLOWER * max(self.norm / (self._recent[-1] or inf), least) * self.norm
        last = expected <= self._rest and (level.carry is not None or level.held is None)
        return "V" if last and self.options.cycle == "F" else self.options.cycle

    @property
    def _hardly_fed(self) -> bool:
        """Whether a line has next to no points of full film, which are what fixes the void that goes round. Collective."""
        return self.problem.reduce.min((self._levels[0].z[1:-1, 1:-1] > 0.0).mean(axis=1)) < FEW

    def destroy(self) -> None:
        super().destroy()
        self._levels, self._fields = [], None

    def _retreat(self) -> bool:
        """Do without the coarsest grids, or where little is gained correct points beyond their front; false if all is done.

        On the coarsest grids the film's cavities may be too small to be seen. The finest grid that can be solved exactly takes
        their place: the problem's own one if it is small. Where a front crosses a deep dimple, corrections that stop at it
        overshoot there, this way and that from cycle to cycle.
        """
        own = self._levels[0].nx * self._levels[0].ny
        around = self._levels[0].periodic[0] and own > OWN and self.norm > CLOSE  # what goes round has no coarse grid
        if (around and self._hardly_fed) or self._following is not None:
            return False
        if self._mixing and self._truncation == TRUNCATIONS["clip"] and self.norm > VAIN * self._recent[1]:
            self._truncation = TRUNCATIONS["none"]
        elif (depth := self._less_deep()) is not None:
            self._depth = depth
        else:
            return False
        self._recent = (inf,) * WINDOW
        if self._mixing:
            self._mixing.forget()
        return True

    def _less_deep(self) -> int | None:
        """How many grids are left without the next coarsest ones; None if no fewer can do."""
        own = self._levels[0].nx * self._levels[0].ny
        sizes = [level.nx * level.ny for level in self._levels[: self._depth - 1]]
        found = (k + 1 for points in (EXACT if own > OWN else (OWN,)) for k, size in enumerate(sizes) if size <= points)
        return next(found, None)
