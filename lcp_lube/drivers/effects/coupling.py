"""Films whose coefficients depend on their answer: one loop for all effects, pressure, temperature, shear, deformation.

In a time step by multigrid density alone is no loop: its film takes those of its pressures after every cycle (`tangent.renew`).

The fields x that effects make of an answer (`film.effects`) go into the film's coefficients, the film is solved as any other,
and the effects make new fields G(x) of its answer. x = G(x) is solved by PETSc's Anderson acceleration (SNES type
anderson, `loop`), which has no factor to tune: each step costs one solve of a film, started from the one before.

Barus' viscosity stays outside of the loop: it is a change of the unknown (problems/film/fluid.py), exact and one solve, also
where other effects vary the viscosity as well. The certificate of the answer has the film's equations with the coefficients
that it was solved with, `coupling`, the largest relative change that the effects still make of these, and the effects' own.
"""

from dataclasses import replace
from math import prod
from typing import Any

import numpy as np

from ...problems.film.effects import Cells, neutral
from ...problems.film.fluid import Law
from ...problems.film.model import Model
from ...problems.film.turning import ahead
from ...problems.solution import Enclosure, Fields, Outcome, Solution
from ...problems.transfer import Transfer
from ...registry import SMALL
from ...scenes.moving import film_of
from ...scenes.scene import Solvable
from ...solvers.enclosure import bounds_of
from ..ask import Ask, Start
from ..compose import Inner
from ..levels import level_shapes
from .coupling_file import CouplingFile
from .loop import Loop

ROUNDED = 2.0**-50  # relative error of p made of q, at most
NESTED_ABOVE = 2_000  # points in the plane from which the fields are first found on coarser grids


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether an effect makes the film's coefficients depend on its answer."""
    model = film_of(scene)
    return model is not None and (model.law is not None or bool(model.effects))


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Solution of a scene with effects. Collective.

    Returns
    -------
    Solution : of the film with the coefficients found; where they do not settle or no film can be solved with them, the last
        state, its outcome and the reason. settings['details'] has fluid_solves, the number of films solved on this grid,
        but for looks at a law's end.

    Raises
    ------
    InputError : a scheme that has no faces where densities or lifts could act.
    """
    model: Model = scene.model  # type: ignore[union-attr]
    if not model.effects and not model.dense:
        loop = Loop(scene, _reduced(ask, model.law), inner)
        loop.film({})
        loop.change = 0.0
        return _told(ask, loop)
    if model.stored is not None:
        from . import density_step  # here: of marches alone

        if density_step.applies(scene, ask) and (found := density_step.solve(scene, ask)) is not None:
            return found
    file = CouplingFile(scene, ask)
    with file.keeper.listening():
        return _settled_on(scene, file.ask, inner, file)


def _settled_on(scene: Solvable, ask: Ask, inner: Inner, file: CouplingFile) -> Solution:
    """The solution on this grid, from that on coarser ones, or from where the file has it."""
    from .settling import settle  # here: Barus' law alone has no loop

    inside = replace(ask, certify=False)
    loop, coarse = Loop(scene, _reduced(inside, scene.model.law), inner), None  # type: ignore[union-attr]
    if file.holds(loop):
        begin = file.restore(loop)
    elif isinstance(loop.ask.start, Start) and (made := loop.ask.start.made) is not None:
        begin, loop.given = loop.vector(neutral(loop.effects, loop.h.size)), [loop.vector(dict(made))]
    else:
        known = _known(loop)
        if known is None:
            coarse = _coarser(scene, inside, inner, loop, file)
            known = _taken(loop, coarse.problem) if coarse is not None else None
        begin = loop.vector(known or neutral(loop.effects, loop.h.size))
    settle(loop, begin, lambda: file.save(loop))
    if loop.solution is None or (ask.certify and loop.answer is not None):  # all of its films were taken from the file
        loop.again(ask.certify)
    if coarse is not None:
        coarse.destroy()
    return _told(ask, loop)


def _reduced(ask: Ask, law: Law | None) -> Ask:
    """The ask with its start in q."""
    if ask.start is None or law is None:
        return ask
    near, found = ask.start.problem, ask.start.fields
    unit = near.p_unit  # type: ignore[attr-defined]
    in_q = {**found, "p": law.reduced(found["p"] * unit) / unit}
    made = ask.start.made if isinstance(ask.start, Start) else None  # a solution would look for it among its numbers
    return replace(ask, start=Start(near, in_q, ask.start.settings, made))


def _known(loop: Loop) -> Cells | None:
    """The fields that a neighbour's answer was solved with, on this grid."""
    near = loop.ask.start
    known = None if near is None else _taken(loop, near.problem)
    return known if near is None or loop.model.stored is None else loop.foreseen(known, near)


def _taken(loop: Loop, problem: object) -> Cells | None:
    """The fields of another problem on this grid; None where it has not all of them."""
    cells: Cells = getattr(problem, "cells", {})
    if not set(loop.names) <= set(cells):
        return None
    grid, own = problem.grid, loop.base.grid  # type: ignore[attr-defined]
    if grid.shape == own.shape:
        return {name: cells[name] for name in loop.names}
    if grid.dim != own.dim:
        return None
    transfer = Transfer(grid, own, ahead=ahead(loop.base, problem))
    found = {name: transfer(cells[name]) for name in loop.names}
    transfer.destroy()
    return found


def _coarser(scene: Solvable, ask: Ask, inner: Inner, loop: Loop, file: CouplingFile) -> Solution | None:
    """The answer on the next coarser grid, as a start: there the loop costs a quarter, or a half in 1D."""
    if ask.nested is False or not nests(scene.shape) or loop.model.grooves:
        return None
    shapes = level_shapes(scene.shape, loop.base.grid.comm.size)
    if len(shapes) < 2 or prod(shapes[-2]) >= prod(scene.shape):
        return None
    given = ask.stopping_for((1e-8, 1e-8))
    loose = {"eps1": max(given.eps1, 1e-5), "max_it": given.max_it}  # of a start
    found = _settled_on(scene.with_shape(shapes[-2]), replace(ask, start=None, stopping=loose), inner, file)
    if not found.converged:
        found.destroy()
        return None
    loop.work += found.settings["details"]["coupling_work"]
    loop.start = found if loop.law.barus == 0.0 else None
    return found


def nests(shape: tuple[int, ...]) -> bool:
    """Whether coarser grids pay: for a line, whose films cost little but what none of them is without, much later."""
    return prod(shape) > (SMALL if len(shape) == 1 else NESTED_ABOVE)


def _told(ask: Ask, loop: Loop) -> Solution:
    """The loop's last answer as a solution of the scene. Collective."""
    solution, first, law = loop.solution, loop.first, loop.law
    assert solution is not None and first is not None  # a film was solved
    eps1 = solution.settings["eps1"]
    outcome, message, reduce = solution.outcome, solution.message, loop.base.reduce
    failure = ""
    if loop.answer is None:  # the first film had no answer
        solution.problem.shares_grid = loop.base.shares_grid  # type: ignore[attr-defined]
        return solution
    at = loop.answer
    problem = at.problem
    if solution.converged and (loop.beyond or not np.isfinite(reduce.max(at.p))):
        outcome = Outcome.NO_SOLUTION
        message = f"no pressure carries the flow: viscosity grows without bound (barus = {law.barus:g} 1/Pa)"
    elif loop.effects:
        with np.errstate(all="ignore"):
            for effect in loop.effects:
                told = effect.report(at)
                problem.more |= told.numbers
                problem.more_fields |= told.fields
                problem.more_measures |= told.measures
                failure = failure or told.failure
        problem.more_measures |= {"coupling": loop.change, **loop.left}
        if failure and loop.found:
            outcome, message = Outcome.NO_SOLUTION, failure
        elif solution.converged and not loop.found:
            outcome = Outcome.MAX_ITERATIONS
            message = f"the coefficients still change by {loop.change:.1e} after {loop.solves} films ({', '.join(loop.names)})"
            if loop.endless and loop.alone:
                outcome, message = Outcome.NO_SOLUTION, loop.endless
            elif loop.endless:  # what others do to the viscosity may change yet
                message = f"{message}: {loop.endless}"
        elif not solution.converged:
            message = f"film {loop.solves} of the coupling: {message}"
    fields = {"p": at.p / problem.p_unit, "r": at.r}
    problem.cells = at.cells | {"stored": at.stored}
    problem.oil = problem.oil if loop.found else None  # numbers of what has not settled are those of the fields
    problem.rigid = None if loop.effects or nests(problem.grid.shape) else loop.base
    certificate = ask.certify_by(problem, fields, eps1)
    enclosure = _band(loop, solution.enclosure, fields) if ask.certify else None
    solution.destroy()
    count = f"{loop.solves} film{'s' * (loop.solves > 1)} solved"
    inside = f"; {', '.join(loop.names)} by Anderson's method" if loop.effects else ""
    by_q = "; viscosity with pressure by a change of unknown" if law.barus else ""
    settings = {**first.settings, "why": [f"coupling: {count}{inside}{by_q}", *loop.told, *first.settings["why"]]}
    if loop.rescued is not None:
        settings |= {"method": loop.rescued.method, "took_over": loop.rescued.asked}
    settings["details"] = {**first.settings["details"], "fluid_solves": loop.solves, "coupling_work": loop.work}
    done = {"problem": problem, "fields": fields, "outcome": outcome, "message": message, "certificate": certificate}
    done |= {"enclosure": enclosure}
    return replace(first, **done, steps=loop.steps, settings=settings, times=loop.times).judged()  # type: ignore[arg-type]


def _band(loop: Loop, of_q: Enclosure | None, fields: Fields) -> Enclosure:
    """The band around the last film's answer, in p. Collective.

    With Barus' law alone it is around the answer of the film whose viscosity follows the pressure: q is a rising function of p.
    What effects vary is held as it was found.
    """
    if of_q is None or not of_q.certified:
        return of_q or Enclosure(False, "no band: no answer")
    problem: Any = loop.answer.problem  # type: ignore[union-attr]
    lower, upper, unit = of_q.lower, of_q.upper, problem.p_unit
    if loop.law.barus:
        lower, upper = (
            {**end, "p": loop.law.pressure(end["p"] * unit * more) * more / unit}
            for end, more in ((lower, 1.0 - ROUNDED), (upper, 1.0 + ROUNDED))
        )
        if not np.isfinite(problem.reduce.max(upper["p"])):
            return Enclosure(False, "no band: viscosity grows without bound within it")
    bounds = bounds_of(problem, fields, lower, upper)
    still = f"with {', '.join(loop.names)} held as found, which the effects still change by {loop.change:.1e}"
    held = still if loop.effects else ""
    message = f"the discrete solution{' ' * bool(held)}{held} is proved to be within {bounds['band_p']:.1e} Pa of p"
    return Enclosure(True, message, lower, upper, bounds, held)
