"""Derivatives through the balance of pads that tilt: differences of solves, Taylor's test, pads that idle, effects."""

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.derivatives.film_gradient import FilmGradient, areas
from lcp_lube.drivers.derivatives.gradient import Adjoint, gradients
from lcp_lube.drivers.motions.coefficients import placed
from lcp_lube.scenes.values import values_of, with_values

TIGHT = {"eps1": 1e-11, "max_it": 200}
THRUST = {"nx": 19, "ny": 9, "balance.tol": 1e-11}
JOURNAL = {"nx": 60, "ny": 5, "balance.tol": 1e-11}


def answer(scene, near=None):
    solution = solve(scene, start=near, stopping=TIGHT)
    assert solution.converged, solution.message
    return solution


def told(solution, name):
    known = values_of(placed(solution.solved_scene, solution))
    return known[name] if name in known else solution.numbers[name]


@pytest.mark.parametrize(
    ("name", "changes", "quantities", "keys", "tol"),
    [
        ("tilting_pad_thrust", THRUST, "h_min,pitch,roll,p_max,friction", "D_outer,pivot_part,mu,balance.load", 1e-6),
        ("tilting_pad_thrust", {**THRUST, "pivot_radius": None}, "h_min,pitch,friction", "D_inner,pad_deg", 1e-6),
        (
            "tilting_pad_journal",
            {**JOURNAL, "pivots_deg": [45.0, 117.0, 189.0, 261.0, 333.0], "pivot_part": 0.56, "p_groove": 1e5},
            "eccentricity,attitude_deg,tilts.2,friction",
            "clearance,preload,p_groove,balance.load",
            1e-6,
        ),
        ("tilting_pad_journal", {**JOURNAL, "balance": None}, "load,tilts.1,p_max", "eccentricity,D", 1e-6),
        (
            "tilting_pad_thrust",
            {**THRUST, "temperature": {"beta": 0.03, "T_in": 313.0}},
            "h_min,pitch,temperature_max",
            "pivot_part,speed_rpm",
            2e-6,
        ),
    ],
)
def test_against_differences_of_solves(name, changes, quantities, keys, tol):
    scene = load_scene(name, changes)
    with answer(scene) as solution:
        found = gradients(scene, solution, quantities.split(","), keys.split(","))
        for key in keys.split(","):
            a = values_of(placed(scene, solution))[key] if key != "balance.load" else scene.balance.load
            d = 5e-5 * (abs(a) or 1e-5)
            ends = []
            for k in (-1, 1):
                with answer(with_values(scene, {key: a + k * d}), solution) as other:
                    ends.append({one.quantity: told(other, one.quantity) for one in found})
            for one in found:
                low, high = (end[one.quantity] for end in ends)
                slope = (high - low) / (2.0 * d)
                least = 1e-10 * abs(one.value) / d
                assert one.gradient[key] == pytest.approx(slope, rel=tol, abs=least), (one.quantity, key)


def test_taylor():
    """What is left falls by four when the step is halved; what was found has no derivative of its own."""
    scene = load_scene("tilting_pad_thrust", THRUST)
    with answer(scene) as solution:
        (found,) = gradients(scene, solution, ["h_min"])
        assert {"h_min", "pitch", "roll"} <= set(found.held)
        left = []
        for part in (2e-2, 1e-2, 5e-3):
            with answer(with_values(scene, {"D_outer": scene.D_outer * (1.0 + part)}), solution) as other:
                left.append(other.settings["balance"]["value"] - found.value - found.gradient["D_outer"] * scene.D_outer * part)
    assert np.log2(np.abs(left[:-1]) / np.abs(left[1:])) == pytest.approx(2.0, abs=0.1)


def test_a_pad_that_idles_keeps_its_tilt():
    scene = load_scene("tilting_pad_journal", {**JOURNAL, "preload": 0.0, "balance.load": 2e4})
    with answer(scene) as solution:
        (found,) = gradients(scene, solution, ["eccentricity"], ["mu"])
        values = []
        for k in (-1, 1):
            with answer(with_values(scene, {"mu": scene.mu * (1 + 1e-4 * k)}), solution) as other:
                values.append(other.settings["balance"]["value"])
    assert found.gradient["mu"] == pytest.approx((values[1] - values[0]) / (2e-4 * scene.mu), rel=1e-6)


def test_the_films_own_derivative():
    """A film that is lifted everywhere by the same: the runner comes as much nearer, and nothing else changes."""
    scene = load_scene("tilting_pad_thrust", THRUST)
    with answer(scene) as solution:
        adjoint = Adjoint(scene, solution, ["p_max", "h_min"])
        film = FilmGradient(adjoint)
        grid = adjoint.equations.grid
        lifted = {name: grid.reduce.dot(film.field(name), areas(grid).ravel()) for name in ("p_max", "h_min")}
        adjoint.destroy()
        assert lifted["h_min"] == pytest.approx(-1.0, rel=1e-8)
        assert abs(lifted["p_max"]) < 1e-8 * solution.p_max / solution.problem.scheme.h.min()
