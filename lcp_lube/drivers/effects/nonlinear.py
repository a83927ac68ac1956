"""Steps of PETSc's methods for nonlinear equations, as the loop of effects takes them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from ...problems.film.effects import neutral

LONG = 300  # films, at most
PATIENT = 150  # half steps in which the least change has to halve
WARMER = 1.0  # of log(viscosity): where a second start is
LONGER, LONGEST = 1.2, 0.5  # of steps, while a change keeps its sign: as in Rprop (Riedmiller and Braun 1993), to a half
VAIN = 100  # films of Newton's method in which the change has to halve
NEWTON = {"snes_mf": "", "snes_linesearch_type": "bt", "mat_mffd_err": 1e-6, "snes_ksp_ew": "", "ksp_max_it": 60}
NEWTON |= {"ksp_gmres_restart": 60, "snes_max_linear_solve_fail": LONG}  # what 60 products give of a step is taken


def steps(
    x: PETSc.Vec,
    kind: str,
    residual: Callable,
    ended: Callable,
    most: int,
    options: Mapping[str, Any],
    prefix: str = "coupling_",
) -> None:
    """At most so many steps of a SNES from x on, with options where the command line has none. Collective.

    residual : of (snes, x, f), fills f. ended : of (snes, iteration, norms), the reason to stop, or 0.
    """
    snes, f = PETSc.SNES().create(x.comm), x.duplicate()
    snes.setOptionsPrefix(prefix)
    snes.setType(kind)
    snes.setTolerances(max_it=most)
    snes.setFunction(residual, f)
    snes.setConvergenceTest(ended)
    given = PETSc.Options(prefix)
    ours = {name: value for name, value in options.items() if not given.hasName(name)}
    for name, value in ours.items():
        given[name] = value
    try:
        snes.setFromOptions()
        snes.solve(None, x)  # some are read then
    finally:
        for name in ours:
            given.delValue(name)
        for obj in (snes, f):
            obj.destroy()


def by_films(loop: Any, x: PETSc.Vec, least: tuple[float, Array], watch: Callable[[], None]) -> tuple[float, Array]:
    """Newton's method from x on, whose products with the Jacobian are differences of films: the best fields. Collective."""
    marks = [(least[0], loop.solves)]

    def residual(snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        nonlocal least
        before = x.array_r.copy()
        loop.change, off = loop.off(before, watch)
        least = min(least, (loop.change, before), key=lambda one: one[0])
        f.setArray(off)

    def ended(snes: PETSc.SNES, it: int, norms: tuple[float, float, float]) -> int:
        if least[0] <= 0.5 * marks[-1][0]:
            marks.append((least[0], loop.solves))
        vain = loop.solves - marks[-1][1] > VAIN or not np.isfinite(norms[2])
        done, failed = PETSc.SNES.ConvergedReason.CONVERGED_FNORM_ABS, PETSc.SNES.ConvergedReason.DIVERGED_DTOL
        return int(done if loop.found else failed if vain else 0)

    steps(x, "newtonls", residual, ended, LONG, NEWTON)
    return least


def by_half_steps(loop: Any, least: tuple[float, Array], watch: Callable[[], None]) -> tuple[float, Array]:
    """The best fields of half steps from film to film, which go on where old ones would mislead. Collective.

    Where little oil flows, what warms it lasts for many films, and fields change by little for long before they settle; where
    warmer oil turns its flow round, a full step throws it far beyond. A field's part of its step gets shorter where it turns.
    """
    loop.told.append(f"from film {loop.solves + 1} on by half steps")
    x, mark, part, before = least[1], (np.inf, loop.solves), np.full_like(least[1], 0.5), 0.0 * least[1]
    while loop.solves - mark[1] < PATIENT:
        loop.change, off = loop.off(x, watch)
        least = min(least, (loop.change, x), key=lambda one: one[0])
        if loop.found or not np.isfinite(loop.change):
            break
        mark = (least[0], loop.solves) if least[0] <= 0.5 * mark[0] else mark
        part = np.where(off * before < 0.0, 0.5 * part, np.minimum(LONGER * part, LONGEST))
        x, before = x - part * np.clip(off, -1.0, 1.0), off
    loop.change = np.nan_to_num(loop.change, nan=np.inf)
    return least


def warmer(loop: Any, x: Array) -> Array:
    """These fields, with warmer oil."""
    parts = zip(loop.names, loop.split(x), strict=True)
    return np.concatenate([part - WARMER * (name in ("viscosity", "warmth")) for name, part in parts])


def beyond(loop: Any) -> str:
    """Why no pressure carries the flow, by a film without each effect that may make viscosity grow without bound; the loop's
    last answer stays. Nothing grows so beside an effect that takes its logarithm. Collective."""
    kept, reason = loop.answer, ""
    if any(getattr(effect, "logarithmic", False) for effect in loop.effects):
        return reason
    for effect in loop.effects:
        if hasattr(effect, "beyond") and kept is not None and not reason:
            out = neutral(loop.effects, loop.h.size)
            for other in loop.effects:
                if other is not effect:
                    other.apply(kept, out)
            if len(loop.effects) == 1 and loop.solves == 1:  # that film is it
                reason = effect.beyond(kept)
            elif loop.film(out):
                reason, loop.answer = effect.beyond(loop.answer), kept
            else:
                loop.again(False)
    return reason
