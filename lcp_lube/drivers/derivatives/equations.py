"""A scene's discrete equations G(p, r) = 0 and numbers Q(p, r) at fields that are held: what its derivatives are made of.

Nothing is solved here. A scene with one of its numbers changed gives other equations at the same fields, p in Pa and r at the
same points of the grid, which moves where the number moves it.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.parallel import Array
from ...errors import InputError, nearest
from ...problems.film import slopes
from ...problems.film.cavity import states
from ...problems.film.forces import attitude, totals, weights
from ...problems.film.grooves import GroovedProblem
from ...problems.film.known import known_fields, known_of
from ...problems.film.lines import some_places
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.tangent import Tangent, effective, tangent
from ...problems.grid import Grid, Places
from ...problems.solution import Solution
from ...registry import DRIVERS
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Scene
from ..ask import Ask
from ..effects.frozen import Frozen
from ..turned import Mirrored

FLIPPED = {"flow_west": "flow_east", "flow_east": "flow_west"}
# What is found around a film that derivatives know of; of what is coupled, a fluid's law alone.
THROUGH = {"decision", "accuracy", "anew", "pads", "balance", "position", "attitude", "turned", "rims", "supplies", "warm"}
THROUGH |= {"coupling", "grooves", "symmetry", "direct"}
DRAGS = ("friction", "friction_torque")
MISFIT = "supply_misfit_"  # by which a supply's source and film disagree, 0 at the solution
LINES = 64  # of points that terms' sizes are looked at along
STEP = 1e-3  # relative, of the numbers that another one is made of: five values give its derivatives to rounding


class Equations:
    """G and Q of one scene at any p (Pa above p_c) and r of its grid's owned points; where U < 0 in the mirror image's frame.

    Parameters
    ----------
    pressures : of all supplies, Pa above p_c; heeded where a supply's own is to be found.
    dry : the points for whose cavities round edges have been made (`LubricationProblem.dry`).
    solved : the solution's own problem, which is taken, not freed, where the scene's would be the same.
    near : those of a scene near by, whose grid this one has: uneven lines follow the film's edges, none changes sides.

    Raises
    ------
    InputError : no film, or one that goes on in time.
    """

    def __init__(
        self,
        scene: Scene,
        comm: PETSc.Comm | None = None,
        pressures: Sequence[float] = (),
        near: "Equations | None" = None,
        dry: Array | None = None,
        solved: Any = None,
    ):
        if (given := check_film(scene)).effects:
            raise InputError(
                f"{scene.name}: derivatives by the film itself, and errors of cells, are of films without effects; see --model"
            )
        self.scene, self.turned = scene, given.U < 0
        film: Any = Mirrored(scene) if self.turned else scene
        model: Model = film.model
        self.law, self._p_sides = model.law, model.p_sides
        film = Frozen(film, self.law) if self.law else film
        self.film, self.model = film, film.constant if self.law else model
        places = None if near is None else followed(near.grid, near.model, self.model)
        self.lent = type(solved) is LubricationProblem and not (self.turned or self.law or solved.held)
        if self.lent:
            self.constant: LubricationProblem = solved
        elif near is None or places is None or all(at is None for at in places):
            self.constant = film.build(comm)
        else:
            self.constant = replace(self.model, places=places).build(near.grid.shape, comm)
        self._at: tuple[Any, ...] = (None,)  # p, the constant film, and what the fluid makes of it there
        self.constant = self.constant if self.lent else self.constant.revised(dry)
        self.layers: Array | None = None  # `flows.layers` of the solution, where derivatives of drags are wanted
        if near is not None:
            self.constant.layers = near.layers
        self.grid: Grid = self.constant.grid
        if pressures and (held := self.constant.held) is not None:
            q = [float(self.law.reduced(np.array(P))) if self.law else P for P in pressures]
            self.constant.hold_at([replace(one, p=P) if one.open else one for one, P in zip(held.supplies, q, strict=True)])

    def problem(self, p: Array) -> LubricationProblem:
        """The film, with its fluid's coefficients at p."""
        if self.law is not None and not (self._at[0] is p and self._at[1] is self.constant):
            self._at = p, self.constant, effective(self.constant, self.law, p, self._p_sides)
        return self.constant if self.law is None else self._at[2]

    def tangent(self, p: Array, r: Array) -> Tangent:
        return tangent(self.problem(p), self.law, self.constant, p / self.constant.p_unit, r)

    @property
    def held(self) -> Any:
        """Whether an owned point lies in a groove, whose pressure it has; None without grooves."""
        return np.logical_or.reduce(self.constant.columns) if isinstance(self.constant, GroovedProblem) else None

    @property
    def given(self) -> Any:
        """Whether an owned point's pressure is given: a groove's or a supply's. None where there are neither."""
        held = self.constant.held
        return self.held if held is None else held.mask.ravel()

    def balance(self, p: Array, r: Array) -> Array:
        """G in m2/s; in a groove p minus its pressure, in Pa. Collective."""
        problem = self.problem(p)
        G = problem.balance(p / problem.p_unit, r) * problem.scheme.flow_unit
        if isinstance(problem, GroovedProblem):
            for inside, groove in zip(problem.columns, problem.grooves, strict=True):
                G = np.where(inside, p - groove.p, G)
        return G

    def scaled(self, p: Array, r: Array, unit: float) -> Array:
        """`balance` in a unit of flow, and in p_unit where pressures are given."""
        G = self.balance(p, r) / unit
        return G if self.held is None else np.where(self.held, G * unit / self.constant.p_unit, G)

    def terms(self, p: Array, weights: Sequence[Array]) -> Array:
        """Sums of weights' sizes times those of G's terms, in its unit of flow: a measure of rounding. Collective."""
        (ny, _), apart = self.grid.box, max(1, self.grid.box[0] // LINES)
        some = slice(apart // 2, ny, apart)  # they stand for a large film's others
        s, p, *w = self.problem(p).scheme.rows(some), *(a.reshape(self.grid.box)[some] for a in (p, *weights))
        size = np.abs(s.diagonal * p) / self.constant.p_unit + np.abs(s.couette_W) + np.abs(s.couette_E)
        out = np.array([np.einsum("ji,ji->", np.abs(a), size) for a in w])
        return np.asarray(self.grid.comm.allreduce(out * (ny / len(p))))

    def numbers(self, p: Array, r: Array, wanted: Collection[str] | None = None, rest: Any = None) -> dict[str, float]:
        """`slopes.numbers` as the scene has them; rest : the values of those that are not wanted. Collective."""
        wanted = {FLIPPED.get(name, name) for name in wanted} if wanted is not None and self.turned else wanted
        problem = self.problem(p)
        found = slopes.numbers(problem, p, r, wanted)
        fields = known_fields(problem) if wanted is None or wanted or problem.held else None
        if fields is not None:  # a line's numbers are free of the grid's error (`film.known`)
            if wanted is not None and set(wanted) <= set(weights(problem)):  # integrals of the pressure: no flows, no fronts
                told = totals(problem, fields["p"] * problem.p_unit, fields["r"], known_of(problem), wanted)
            else:
                every = problem.quantities(fields)  # by the names of `slopes.numbers`
                told = every | {f"flow_{side}": value for side, value in every["flow"].items()}
                told |= zip(("force_x", "force_y"), every.get("force", ()), strict=False)
            own = problem if self.law is None else self.problem(fields["p"] * problem.p_unit)
            discrete = slopes.numbers(own, fields["p"] * own.p_unit, fields["r"], wanted)
            found = {name: value + (told.get(name, discrete[name]) - discrete[name]) for name, value in found.items()}
        if self.turned:
            found = {FLIPPED.get(name, name): -value if name in DRAGS else value for name, value in found.items()}
        return {name: (rest or found)[name] if value != value else value for name, value in found.items()}

    def slope(self, p: Array, r: Array, name: str, last: bool = False) -> slopes.Slope:
        """dQ/dp (p in p_unit) and dQ/dr of one of `numbers` (`slopes.slope`). Collective."""
        name = FLIPPED.get(name, name) if self.turned else name
        tangent = self.tangent(p, r) if "flow_" in name or (self.law and name in DRAGS) else None
        found = slopes.slope(self.problem(p), tangent, p, r, name, last)
        return slopes.Slope(-found.p, -found.r, value=-found.value) if self.turned and name in DRAGS else found

    def report(self, numbers: dict[str, float]) -> dict[str, float]:
        """What else is told of the film, from its `numbers`."""
        problem, out = self.constant, dict(numbers)
        if problem.shaft is not None:
            out["load"] = math.hypot(out["force_x"], out["force_y"])
            if problem.shaft.widest is not None and out["load"] > 0:
                out["attitude_deg"] = attitude(problem.shaft.widest, (out["force_x"], out["force_y"]), problem.U)
        if "flow_south" in out or "flow_north" in out:
            out["side_leakage"] = out.get("flow_south", 0.0) + out.get("flow_north", 0.0)
        if out["load"] > 0:
            out["friction_coefficient"] = out["friction"] / out["load"]
        for k, one in enumerate(problem.held.supplies if problem.held else (), start=1):
            P = float(self.law.pressure(np.array(one.p))) if self.law else one.p
            out[f"supply_p_{k}"] = P + problem.p_c
            if one.open:
                out[f"{MISFIT}{k}"] = one.misfit(P, out[f"supply_flow_{k}"])[0]
        out["power_loss"] = abs(problem.U) * out["friction"] * (-1.0 if self.turned else 1.0)
        return out | self._extras(out)

    def _extras(self, out: dict[str, float]) -> dict[str, float]:
        """What the scene itself tells beyond that; some tell of several alike films by one."""
        extras = getattr(self.constant, "extras", None)
        if not extras:
            return {}
        flow = {name: out.get(f"flow_{name}", 0.0) for name in slopes.SIDES}
        supplied = [value for name, value in out.items() if name.startswith("supply_flow_")]
        more = extras({**out, "flow": flow, "cavitated_area": 0.0, **({"supply_flow": supplied} if supplied else {})})
        found = {name: value for name, value in more.items() if isinstance(value, float) and name != "cavitated_area"}
        found |= {f"flow_{name}": value for name, value in more.get("flow", {}).items() if f"flow_{name}" in out}
        return found | {f"supply_flow_{k}": value for k, value in enumerate(more.get("supply_flow", ()), start=1)}

    def partials(self, numbers: dict[str, float], name: str) -> dict[str, float]:
        """d(name)/d(number) for those of `numbers` that it is made of.

        Raises
        ------
        InputError : nothing of this name, or nothing with a derivative.
        """
        known = self.report(numbers)
        if name not in known:
            raise InputError(
                f"quantity {name}: of this scene derivatives are known of {', '.join(known)}{nearest(name, known)}"
            )
        out = {}
        for part, value in numbers.items():
            step = STEP * (abs(value) or 1.0)
            f = [self.report({**numbers, part: value + k * step}).get(name, np.nan) for k in (-2, -1, 1, 2)]
            if f[0] == f[1] == f[2] == f[3]:
                continue
            slope = (8.0 * (f[2] - f[1]) - (f[3] - f[0])) / (12.0 * step)
            if slope and math.isfinite(slope):
                out[part] = slope
        return out

    def destroy(self) -> None:
        if not self.lent:
            self.constant.destroy()


def followed(grid: Grid, before: Model, after: Model) -> Places | None:
    """The lines of a grid where the film's edges have moved, as many between two edges; None where edges came or went."""
    out: list[Array | None] = []
    for side, places in enumerate(grid.places):
        if places is None:
            if after.lines(grid.shape)[side] is None:
                out.append(None)
                continue
            places = some_places(grid.shape[side], before.lengths[side], grid.ends[side], grid.shape[side])  # evenly, on edges
        ends = [knots(model, side, grid.periodic[side]) for model in (before, after)]
        if ends[0].size != ends[1].size:
            return None
        out.append(np.interp(places, ends[0], ends[1]))
    return out[0], out[1]


def knots(model: Model, side: int, periodic: bool) -> Array:
    """The edges that lines of a grid follow, and the two ends."""
    axis, L = "xy"[side], model.lengths[side]
    within = np.unique([t for t in model.edges_along(axis) if 0.0 < t < L])
    if not within.size:
        return np.array([0.0, L])
    ends = (within[-1] - L, within[0] + L) if periodic else (0.0, L)
    return np.concatenate([[ends[0]], within, [ends[1]]])


def check_film(scene: Scene) -> Model:
    """The scene's film.

    Raises
    ------
    InputError : no film, one that goes on in time, or one around which something is found that derivatives do not know of.
    """
    model = film_of(scene)
    if model is None or motion_of(scene) is not None:
        raise InputError(f"scene {scene.name}: gradients are of films with cavitation that stand still in time")
    ask = Ask()
    for name, entry in DRIVERS.items():
        if name not in THROUGH and not entry.idle(scene) and entry.load().applies(scene, ask):
            raise InputError(f"scene {scene.name}: derivatives do not go through its '{name}' yet: {entry.line}")
    return model


def fields_of(solution: Solution) -> tuple[Array, Array]:
    """p (Pa above p_c) and r of a film's solution, in the frame of `Equations`."""
    problem: Any = solution.problem
    fields = problem.there(solution.fields)
    return fields["p"] * problem.p_unit, fields["r"]


def cavity_of(equations: Equations, p: Array, r: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether a point is cavitated, and whether it is about to change: p and r both vanish there. Collective."""
    cavity, switching = states(equations.grid.reduce, p, r)
    if equations.given is not None:
        switching &= ~equations.given
        cavity &= ~equations.given
    return cavity, switching


def unknowns(cavity: NDArray[np.bool_], p: Array, r: Array, p_unit: float) -> Array:
    """z: p (p_unit) where the film is full, -r where it is not."""
    z = np.asarray(p / p_unit)
    return np.negative(r, out=z, where=cavity)  # type: ignore[no-any-return]


def right_side(slopes_of: Mapping[str, slopes.Slope], weights: Mapping[str, float], cavity: NDArray[np.bool_]) -> Array:
    """dQ/dz of the adjoint equation, of a number that is made of parts with these weights."""
    total: Array | None = None
    for part, w in weights.items():
        one = np.multiply(w, slopes_of[part].p).ravel()
        np.copyto(one, -w * slopes_of[part].r, where=cavity)
        total = one if total is None else np.add(total, one, out=total)
    return np.zeros(cavity.size) if total is None else total
