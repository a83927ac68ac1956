"""Scene files with sides of every kind, on points that neither 2 nor 3 ranks divide; and their reduced solve by any method."""

from functools import partial

from lcp_lube.drivers import compose
from lcp_lube.drivers.ask import Ask
from lcp_lube.drivers.symmetry import parts_for, solve_part
from lcp_lube.registry import DRIVERS


def reduced_solve(scene, **how):
    """What is left of a scene is solved, whatever method is named. Collective."""
    ask = Ask(**how)
    direct = partial(compose.solve, level=len(DRIVERS) - 1)
    problem = scene.build(ask.comm)
    part = parts_for(scene).part_of(scene, problem)
    if part is None:
        problem.destroy()
        return direct(scene, ask)
    return solve_part(part, problem, ask, direct)


HEAD = """
family = "bearing"
dimension = 2
L_mm = 10
width_mm = 6
U = 1
nx = 20
ny = 11
[fluid]
mu = 0.01
p_supply = 3e5
"""
WEDGE = '[film]\nshape = "linear"\nh_start_um = 3\nh_end_um = 1\n'
PAD = '[[film]]\nshape = "linear"\nh_start_um = 1.1\nh_end_um = 1\n[[film]]\nshape = "pocket"\ndepth_um = 1\nx_mm = [2, 5]\n'
RING = '[film]\nshape = "journal"\nc_um = 5\neccentricity = 0.6\n[sides]\nwest = "periodic"\neast = "periodic"\n'
TILTED = '[film]\nshape = "formula"\nh = "3 - 150*x + 100*y"\nunit = "um"\n[sides]\n'
SCENES = {
    "line": HEAD + WEDGE + '[sides]\nsouth = "symmetry"\nnorth = "closed"\n',
    "mirror": HEAD + PAD,
    "mirror_ring": HEAD + RING,
    "constant": HEAD + '[film]\nshape = "constant"\nh_um = 2\n',
    "ring": HEAD + RING + 'north = "symmetry"\n',
    "tube": HEAD + '[film]\nshape = "formula"\nh = "1e-6 + 3e-4*(0.01 - x) + 5e-7*sin(2*pi*y/0.006 + 1)"\n'
    '[sides]\nsouth = "periodic"\nnorth = "periodic"\n',
    "dead_end": HEAD + TILTED + 'east = "closed"\n',
}
REDUCED = {"line": "line", "mirror": "mirror", "mirror_ring": "mirror", "constant": "constant"}
