"""Steps of PETSc's methods for nonlinear equations, as the loop of effects takes them."""

from collections.abc import Callable, Mapping
from typing import Any

from petsc4py import PETSc


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
