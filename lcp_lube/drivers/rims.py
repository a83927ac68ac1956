"""Films with round edges or corners, or that rupture where they come in: solved, and once more with faces made for cavities.

Whatever acts on the film, its supplies and effects settle both times, on faces that are held: those of a full film first, and
then those of its cavities (`problems/film/rims`). So each of the two is one discrete problem, with its certificate and its
derivatives, nothing goes round in circles, and what an effect changes goes to nothing with the effect.

Faces at the side that a film comes in by (`problems/film/inlets`) are made so for films that stand by themselves: one that a
search or a march moves on would jump where its first cavity comes and goes.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from petsc4py import PETSc

from ..base.parallel import Array
from ..problems.facts import Facts
from ..problems.film.cavity import cavitated
from ..problems.film.halves import doubled
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.rims import state_of
from ..problems.film.stored import Dry
from ..problems.solution import Fields, Solution
from ..scenes.moving import film_of, motion_of
from ..scenes.scene import Derived, Scene, Solvable
from .ask import Ask
from .chain import added
from .compose import Inner
from .film_part import Part
from .turned import Mirrored

KNOWN = 1e-4  # ||F|| at which cavities are known: loads move by 1e-9 at most beside those of a first solve to the end
SUMS = "fluid_solves", "coupling_work", "cycles", "work_units"  # of both solves
# Settings of the second solve:
LAST = ("eps1", "method", "took_over", "system", "recipe", "ksp_type", "pc_type", "supply_pressures")


@dataclass(frozen=True)
class Revised(Derived):
    """A scene with the faces that know cavities made for these, on its own grid.

    mirror : half of it, where that is what is solved: its faces are the other half's too. Made by themselves, two that mirror
    each other may see a rim on either side of a look.
    """

    dry: Dry
    mirror: Part | None = None

    @cached_property
    def model(self) -> Model:
        return replace(self.whole.model, dry=self.dry, places=self.dry.grid.places)

    def with_shape(self, shape: tuple[int, ...]) -> Any:
        return self.whole.with_shape(shape)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return replace(self.whole.facts(comm), twice=False)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        grid = getattr(self.whole, "grid", None)
        if self.mirror is None:
            return self.model.build(self.shape, comm, grid)
        model, shape = self.mirror.own
        half = replace(model, dry=self.dry).build(shape, comm)
        made = doubled(half.scheme), None
        half.destroy()
        return self.model.build(self.shape, comm, grid, made)


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene is a film whose round edges cut faces, one with corners, or which may rupture where it comes in."""
    model = film_of(scene)
    cut = model is not None and (model.cut or model.cornered)
    return model is not None and model.dry is None and (cut or (ask.alone and _by_itself(scene, model)))


def _by_itself(scene: Any, model: Model) -> bool:
    """Whether the film may rupture at the side it comes in by, one without pressure, and nothing moves or changes it."""
    west = model.sides[0]
    plain = isinstance(scene.whole if isinstance(scene, Mirrored) else scene, Scene) and motion_of(scene) is None
    opens = plain and model.knows and model.U > 0.0 and west.kind == "open" and not west.p
    return opens and not (model.grooves or model.effects or model.law or model.supplies)


def _behind(problem: Any, fields: Fields) -> int:
    """Lines with a cavity at their first point behind an open west side. Collective."""
    grid = problem.grid
    p, r = (fields[name].reshape(grid.box)[:, :1] * (grid.x_start == 0) for name in "pr")
    return int(problem.reduce.sum(cavitated(problem.reduce, p.ravel(), r.ravel()).astype(float)))


def _mirror(scene: Any, model: Model, first: Solution) -> Part | None:
    """Half of the film, where it was solved by that, up to a line in the middle: what its faces are made of is all there."""
    problem: Any = first.problem
    found = first.settings["details"].get("reduction") == "mirror" and problem.grid.comm.size == 1
    found = found and not problem.grid.periodic[1]  # faces between the last and the first line are in neither half
    plain = model.scheme == "face" and model.U > 0.0 and model.stored is None and not model.supplies
    return Part(scene, "mirror", problem) if found and plain and scene.shape[1] % 2 else None


def _has_corners(problem: Any, state: Array) -> bool:
    """Whether there are corners about which faces are made. Collective."""
    from ..problems.film.recesses import corners_on  # here: few films have any

    return corners_on(problem.grid, problem.film, state) is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The second solution; the first where nothing asks for other faces, or where there is no second one. Collective."""
    model: Any = film_of(scene)
    corners = model.cornered and not model.cut and ask.stopping is None
    found = _solve(scene, replace(ask, cavities=KNOWN) if corners and ask.cavities is None else ask, inner)
    return _solve(scene, replace(ask, cavities=None), inner) if found is None else found  # type: ignore[return-value]


def _solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution | None:
    """None where the second solve fails after a first one that was to know cavities alone. Collective."""
    model: Any = film_of(scene)
    cut = model.cut or model.cornered
    loose = ask.stopping if ask.cavities is None else {**(ask.stopping or {}), "eps1": ask.cavities}  # type: ignore[dict-item]
    first = inner(scene, replace(ask, certify=False, stopping=loose) if cut else ask)
    problem: Any = first.problem
    if not first.converged:
        return first
    behind = not model.cut and ask.alone and _by_itself(scene, model) and _behind(problem, first.fields)
    if not cut and not behind:
        return first
    state = state_of(problem, first.fields["p"], first.fields["r"])
    count = int(problem.reduce.sum((state > 0.0).astype(float)))
    made = (bool(model.cut or behind) and count > 0) or (model.cornered and bool(ask.cavities or _has_corners(problem, state)))
    again = replace(ask, start=first, nested=False, monitor=None, checkpoint=None, resume=None)
    spared = made and problem.plain and problem.held is None and problem.coefficients_for is not None
    if spared:
        problem.free_matrices()
        del problem.scheme  # of what was solved its fields alone are needed, unless this is all there will be
    second = (
        inner(Revised(scene, Dry(state, problem.grid), _mirror(scene, model, first)) if made else scene, again)
        if made or ask.certify or ask.cavities
        else first
    )
    if second is first:
        return first
    settings = first.settings | {name: second.settings[name] for name in LAST if name in second.settings}
    if not second.converged and ask.cavities:
        second.destroy()
        first.destroy()
        return None
    if not second.converged:
        if spared:
            problem.scheme = problem.coefficients_for(problem.dry)[0]
        first.because(f"faces are those of a full film: {second.message}")
        second.destroy()
        return first
    details, more = settings["details"], second.settings["details"]
    told = {name: details.get(name, 0.0) + more[name] for name in SUMS if name in more}
    told |= {name: more[name] for name in ("convergence_factor",) if name in more}
    settings["details"] = {**details, **told, **({"revised": count} if made else {})}
    times, steps = added(first.times, second.times), [*first.steps, *second.steps]
    first.destroy()
    return replace(second, settings=settings, times=times, steps=steps, levels=first.levels)
