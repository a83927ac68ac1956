"""A time step's film and the pressures of its supplies that follow from flows, by one Newton's method for both.

`supplies` finds the pressures around solves of the film, each of which has them given. From the step before, both are near:
here both are unknowns of each step (`sources`). A film of constant density is linear at its signs, and exact once these stay;
of one whose density follows the pressure `density_step` takes the steps. Inside of the loop of `coupling` it is such a film
that is solved, so that pressures and effects are found by one loop. Where film and supplies are symmetric about the middle of
the width half is solved of large films. Multigrid has the pressures on its grids (`solvers/fas/following`).
"""

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.model import Model
from ...problems.grid import Grid
from ...problems.solution import Outcome, Solution, Step
from ...problems.transfer import Pick, numbers
from ...scenes.scene import Solvable
from ...solvers.relaxation import relaxation
from .. import film_part, symmetry
from ..ask import Ask
from ..compose import Inner
from ..effects import coupling
from ..effects.frozen import Frozen
from ..sources import CONSTANT, SWEEPS, Sources, z_of

WHY = "supplies: their pressures are unknowns of each step beside the film's"
MOST = 12  # steps, after which `supplies` takes over
HALVED = 3000  # points of symmetric films from which two builds and half the factors cost less than one of each


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution | None:
    """The film at the step's end with the pressures of its supplies; None where it is not found so. Collective."""
    model: Model = scene.model  # type: ignore[union-attr]
    begun = model.stored is not None and ask.start is not None and "supply_pressures" in ask.start.settings
    if not begun or ask.certify or ask.method not in ("active-set", "fas"):
        return None
    try:
        if ask.method == "fas":
            solution = inner(scene, replace(ask, rescue=False))
        else:
            solution = coupling.solve(scene, ask, _film) if coupling.applies(scene, ask) else _film(scene, ask)
    except _NotFound:
        return None
    problem: Any = solution.problem
    P = [one.p for one in problem.held.supplies]
    if not solution.converged:
        solution.destroy()
        return None
    problem.hold_at(model.supplies, P)
    solution.certificate = ask.certify_by(problem, solution.fields, solution.settings["eps1"])
    why = [WHY, *(one for one in solution.settings["why"] if not one.startswith("supplies"))]
    solution.settings |= {"supply_pressures": P, "why": why}
    return solution.judged()


class _NotFound(Exception):
    """The film's steps do not end."""


def _film(scene: Solvable, ask: Ask) -> Solution:
    """A film of constant density and viscosity, its supplies held at the pressures found. Collective."""
    begun, near = perf_counter(), ask.start
    assert near is not None  # as `solve` found
    whole: Any = scene.build(ask.comm)
    large = whole.grid.size > HALVED and film_part.applies(scene) and not symmetry.why_not(ask)
    part = film_part.part_of(scene, whole) if large and film_part.promising(scene) else None
    film: Any = part.build(whole.grid.petsc_comm) if part is not None else whole
    model, law = (scene.constant, scene.law) if isinstance(scene, Frozen) else (scene.model, CONSTANT)  # type: ignore[union-attr]
    sources = Sources(model.supplies, law, like=1 if part is None else 2)
    z = z_of(near, film.p_unit)
    z = z if part is None else _taken(whole.grid, film.grid, numbers(film.grid), z)
    P, inside, steps = sources.foreseen(film, z), film.held.mask.ravel(), list[Step]()
    sweeps = ask.options.get("sweeps", 0)
    while True:
        film.hold_at(sources.held(P))
        z = sources.put(film, z, P)
        sweep = relaxation(film) if sweeps or len(steps) > 2 else None
        if sweep is not None:
            fields = sweep({"p": np.maximum(z, 0.0), "r": np.maximum(-z, 0.0)}, sweeps or SWEEPS)
            z = fields["p"] - fields["r"]
        cavity = (z < 0.0) & ~inside
        found = sources.step(film, cavity, z, film.balance(np.maximum(z, 0.0), np.maximum(-z, 0.0)), P)
        if found is None or len(steps) == MOST:
            for one in {film, whole}:
                one.destroy()
            raise _NotFound
        z, P = z + found[0], P + found[1]
        changed = film.reduce.sum((cavity != ((z < 0.0) & ~inside)).astype(float))
        steps.append(Step(changed, film.reduce.max(np.abs(found[0])), 1.0, 1))
        if not changed:
            break
    if part is not None:
        z = _taken(film.grid, whole.grid, part.places(whole.grid), z)
        film.destroy()
        part.lent.give_back()
    film = whole
    film.hold_at(sources.held(P))
    film.free_matrices()
    fields = {"p": np.maximum(z, 0.0), "r": np.maximum(-z, 0.0)}
    certificate = ask.certify_by(film, fields, near.settings["eps1"])
    why = [one for one in near.settings["why"] if not one.startswith("coupling")]
    times = {"setup": 0.0, "assembly": 0.0, "linear": 0.0, "total": perf_counter() - begun}
    message = f"no sign changes any more after {len(steps)} steps"
    return Solution(film, fields, Outcome.CONVERGED, message, certificate, steps, {**near.settings, "why": why}, times).judged()


def _taken(source: Grid, target: Grid, places: Any, z: Array) -> Array:
    """z at these lines and columns of a grid. Collective."""
    take = Pick(source, target, *places)
    found = take(z)
    take.destroy()
    return found
