"""Every method, on every matrix that it can use, gives every built-in scene the same answer, or refuses or fails openly.

Generated from the registry: a new scene, method or matrix is in it without a line here. The answer to agree with is that of
`auto`.
"""

from functools import cache

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, solve
from lcp_lube.registry import METHODS, scene_names
from lcp_lube.scenes.effects.named import named
from lcp_lube.scenes.moving import motion_of

ANSWERED = ("p", "v")
AGREE = 1e-6  # of the largest value; the interior methods stop at ||F|| = 1e-8, which leaves sqrt of that at fronts


@cache
def small(name):
    """The scene on few points, on an eighth of its own in each direction or the fewest that its rules allow; few time steps.

    With effects it is looked at where it stands: a balance would try places with films that some methods do not find.
    """
    scene = load_scene(name)
    shape, motion = scene.shape, motion_of(scene)
    steps = {"balance": None} if named(scene) and getattr(scene, "balance", None) is not None else {}
    if name == "squeeze":
        steps |= {"steps": 12}  # of any length: its film ruptures late
    elif motion:
        steps |= {"motion.steps": 6, "motion.t_end": motion.t_end * 24 / motion.steps}  # longer ones: all end with cavities
    for factor in (8, 4, 2):
        few = [max(9, (n + 1) // factor - 1) for n in shape]
        try:
            return load_scene(name, steps | ({"n": few[0]} if len(few) == 1 else {"nx": few[0], "ny": few[1]}))
        except InputError:  # a number of points that its rules forbid
            continue
    return load_scene(name)


@cache
def reference(name):
    with solve(small(name)) as solution:
        return solution.converged, {field: np.array(solution.fields[field]) for field in ANSWERED if field in solution.fields}


def cases():
    """Scene, method, system: all that the registry says can be."""
    for name in scene_names():
        kind = load_scene(name).facts().kind
        for method, entry in METHODS.items():
            entry = entry.of(kind)
            if kind in entry.kinds:
                for system in entry.systems or [""]:
                    yield name, method, system


@pytest.mark.parametrize("name,method,system", list(cases()))
def test_agrees_or_says_why_not(name, method, system):
    converged, fields = reference(name)
    assert converged
    given = {"method": method, "rescue": False} | ({"system": system} if system else {})
    try:
        solution = solve(small(name), **given)
    except InputError as error:
        assert method in str(error) or system in str(error)
        return
    with solution:
        if not solution.converged:
            assert solution.message
            return
        for field, expected in fields.items():
            assert np.abs(solution.fields[field] - expected).max() <= AGREE * (np.abs(expected).max() or 1.0)
