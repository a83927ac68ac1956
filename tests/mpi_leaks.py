"""Solves of every kind on any number of ranks, some with `destroy` and some without: what is left when PETSc ends, it lists."""

import gc
import sys
import weakref

import petsc4py

petsc4py.init(["leaks", "-objects_dump"])

import numpy as np  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from lcp_lube import Complementarity, load_scene, solve  # noqa: E402
from lcp_lube.base.owned import collect  # noqa: E402
from lcp_lube.drivers.motions.coefficients import coefficients  # noqa: E402
from lcp_lube.registry import METHODS  # noqa: E402

SCENES = {
    "lubrication": ("problem4", {"n": 12}),
    "box": ("obstacle_bratu", {"n": 12}),
    "equations": ("bratu", {"n": 12}),
    "mixed": ("ehl_line", {"n": 40}),
}
DRIVEN = {
    "march": ("moving_texture", {"n": 20, "motion.steps": 3}),
    "free march": ("dynamic_journal", {"nx": 16, "ny": 4, "motion.steps": 3, "motion.t_end": 3e-4}),
    "balance": ("pocketed_pad", {"n": 30, "balance.load": 3e4}),
    "place of a journal": ("two_groove_journal", {"nx": 36, "ny": 6, "balance.load": 2e3}),
    "pads": ("tilting_pad_thrust", {"nx": 14, "ny": 7}),
}


def of_a_user():
    A = 2 * np.eye(20) - np.eye(20, k=1) - np.eye(20, k=-1)
    return Complementarity(lambda v: A @ v - 1.0, lambda v: A, lower=np.zeros(20), upper=np.full(20, 5.0), x0=np.zeros(20))


def cases():
    """Names, and functions that make a solution."""
    for method, entry in METHODS.items():
        for kind in entry.kinds:
            if kind == "user":
                if PETSc.COMM_WORLD.size == 1:
                    yield f"{method} {kind}", lambda method=method: solve(of_a_user(), method=method, rescue=False)
                continue
            for system in entry.of(kind).systems or ("auto",):
                how = {"method": method, "system": system, "rescue": False, "stopping": {"max_it": 4}}
                yield f"{method} {kind} {system}", lambda how=how, kind=kind: solve(load_scene(*SCENES[kind]), **how)
    for name, scene in DRIVEN.items():
        yield name, lambda scene=scene: solve(load_scene(*scene))
    yield "accuracy", lambda: solve(load_scene("problem4"), accuracy=0.05, quantity="load")
    yield "certify", lambda: solve(load_scene("problem4", {"n": 12}), certify=True)
    yield "film's derivatives", lambda: asked("hybrid_journal", {"nx": 36, "ny": 8}, "clearance")
    yield "derivatives with effects", lambda: asked("lined_pad", {"n": 40}, "U")


def asked(name, changes, key):
    """With derivatives, stiffness and damping."""
    scene = load_scene(name, changes)
    solution = solve(scene)
    solution.gradient("load", [key])
    coefficients(scene, solution, [0.0, 100.0])
    return solution


for name, make in cases():
    for freed in (True, False)[PETSc.COMM_WORLD.size > 1 :]:  # on several ranks `collect` frees what was dropped
        solution = make()
        seen = weakref.ref(solution), weakref.ref(solution.problem)
        if freed:
            solution.destroy()
            solution.destroy()
        del solution
        gc.collect()
        collect(PETSc.COMM_WORLD)
        if any(one() is not None for one in seen):
            sys.exit(f"{name}: still referred to, freed = {freed}")
PETSc.Sys.Print("all made and dropped")
