"""Everything composes with everything, or the one table says why not."""

from itertools import combinations

import numpy as np
import pytest

from lcp_lube import Complementarity, InputError, load_scene, solve
from lcp_lube.drivers.compose import CANNOT
from lcp_lube.registry import DRIVERS

PAD = {"family": "bearing", "L_mm": 10, "U": 1.0, "n": 23, "fluid": {"mu": 0.01, "p_supply": 1e5}}
WEDGE = {"film": [{"shape": "parabola", "h_min_um": 1, "h_max_um": 3}]}
# What is asked of a scene: changes of the scene, or of how it is solved. A test adds the files.
SCENE = {
    "balance": {"balance": {"load": 3000.0}},
    "coupling": {
        "fluid": {"mu": 0.01, "p_supply": 1e5, "barus": 1e-8, "density": "dowson-higginson"},
        "temperature": {"beta": 0.03, "T_in": 320.0},
    },
    "symmetry": {"dimension": 2, "width_mm": 8, "nx": 23, "ny": 11},
}
ASK = {
    "accuracy": {"accuracy": 0.2},
    "certify": {"certify": True},
    "checkpoint": {"checkpoint": "run.chk"},
    "nested": {"nested": True},
    "start": {"start": None},
    "method": {"method": "active-set"},
    "whole": {"reduction": False},
}


def answer(scene, how, folder):
    """A solution's outcome, or the sentence that refuses it."""
    near = solve(scene, balance=None) if "start" in how else None
    how = {**how, **({"checkpoint": folder / "run.chk"} if "checkpoint" in how else {}), **({"start": near} if near else {})}
    try:
        solution = solve(scene, **how)
    except InputError as error:
        return str(error)
    finally:
        if near:
            near.destroy()
    outcome = (solution.converged or solution.outcome == "load_not_carried", solution.message)
    solution.destroy()
    return outcome


def refused(names, how):
    """Whether the table has a reason against it."""
    return [reason for name, option, reason in CANNOT if name in names and how.get(option)]


@pytest.mark.parametrize("pair", list(combinations([*SCENE, *ASK], 2)), ids="-".join)
def test_films(pair, tmp_path):
    data, how = {**PAD, **WEDGE}, {}
    for name in pair:
        data |= SCENE.get(name, {})
        how |= ASK.get(name, {})
    found, reasons = answer(load_scene(data), how, tmp_path), refused(pair, how)
    assert (isinstance(found, str) and any(reason in found for reason in reasons)) if reasons else found[0], found


@pytest.mark.parametrize("option", ASK)
@pytest.mark.parametrize("scene", ["squeeze", "obstacle_bratu", "bratu", "ehl_line", "user"])
def test_other_scenes(scene, option, tmp_path):
    if scene == "user":
        made = Complementarity(lambda x: x - 1.0, lambda x: np.eye(3), [0] * 3, [np.inf] * 3, [2.0] * 3)
    else:
        made = load_scene(scene, {"n": 15, **({"steps": 10} if scene == "squeeze" else {})})
    how = dict(ASK[option])
    if option == "start":
        near = solve(made)
        how = {"start": near}
    if option == "method":
        how = {"method": {"bratu": "newton", "user": "semismooth"}.get(scene, "active-set")}
    if option == "checkpoint":
        how = {"checkpoint": tmp_path / "run.chk"}
    names = {"squeeze": ("time",), "user": ("user",)}.get(scene, (made.problem_kind,))
    reasons = refused(names, how)
    try:
        solution = solve(made, **how)
    except InputError as error:
        # Beyond the table, a method says itself what it cannot.
        assert any(reason in str(error) for reason in [*reasons, "from a coarser grid", "cannot be taken up again"]), error
    else:
        assert not reasons and solution.converged, solution.message
        solution.destroy()


def test_the_table_names_what_there_is():
    kinds = {"lubrication", "box", "equations", "mixed", "user"}
    assert all(name in DRIVERS or name in kinds for name, *_ in CANNOT)
    assert len({(name, option) for name, option, _ in CANNOT}) == len(CANNOT)
