"""Damping and stiffness against closed forms, published squeeze films and nonlinear time steps."""

import csv
import math

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients, motions_of, stability
from lcp_lube.drivers.motions.response import Response
from lcp_lube.registry import PACKAGE

FOLDERS = (PACKAGE / "published", PACKAGE.parent / "benchmarks" / "published")
TABLE = next(path for folder in FOLDERS if (path := folder / "dynamics" / "butenschoen_squeeze.csv").is_file())


def test_the_plane_slider():
    """W = 6 mu U L^2/d^2 (log m - 2 (m - 1)/(m + 1)), m = (h + d)/h at the outlet's h: k = -dW/dh; c = 2 L W/(U d)."""
    mu, U, L, h, d = 0.02, 3.0, 0.05, 2e-5, 2e-5
    film = {"shape": "linear", "h_start": h + d, "h_end": h}
    scene = load_scene({"family": "bearing", "L": L, "U": U, "n": 400, "fluid": {"mu": mu}, "film": film})
    solution = solve(scene)
    (found,) = coefficients(scene, solution)
    solution.destroy()

    def load(h):
        m = (h + d) / h
        return 6.0 * mu * U * L**2 / d**2 * (math.log(m) - 2.0 * (m - 1.0) / (m + 1.0))

    k = -(load(h * (1 + 1e-5)) - load(h * (1 - 1e-5))) / (2e-5 * h)
    assert found.motions == ("z",)
    assert found.K[0, 0] == pytest.approx(k, rel=1e-3) and found.C[0, 0] == pytest.approx(2.0 * L * load(h) / (U * d), rel=1e-3)


def test_the_short_bearing_with_half_a_film():
    """Ocvirk's closed form by the same linearisation: a full film all round, whose pressure counts where it is positive.

    The film is a hundredth as wide as long, where flow round the journal counts for nothing; K and C go with the width cubed.
    """
    R, c, mu, omega, e, B = 0.05, 1e-4, 0.1, 157.1, 0.2663, 1e-3
    scene = load_scene(
        {
            "family": "bearing", "dimension": 2, "L": 2 * math.pi * R, "width": B, "U": omega * R, "nx": 180, "ny": 63,
            "fluid": {"mu": mu, "p_supply": 1e9, "p_c": 0.0}, "sides": {"west": "periodic", "east": "periodic"},
            "film": {"shape": "journal", "c": c, "eccentricity": e, "widest": math.pi * R},
        }
    )  # fmt: skip
    solution = solve(scene, method="active-set")  # so much pressure at the ends that no void can be
    p = solution.fields["p"] - 1e9 / solution.problem.p_unit
    positive = p > 0
    weight = solution.problem.p_unit * solution.problem.grid.cell * np.where(positive, p, 0.0)
    theta = np.broadcast_to(scene.turning.theta(solution.problem.grid.x), solution.problem.grid.box).ravel()
    along = math.atan2(np.sum(weight * np.sin(theta)), np.sum(weight * np.cos(theta)))  # the load's line
    motions = motions_of(scene.turning, False, 0.0, along)
    response = Response(solution.problem, scene.model, solution.fields, motions)
    response._sides = [np.where(positive, side, 0.0) for side in response._sides]
    K, C = (matrix * (0.03 / B) ** 3 for matrix in (response.stiffness(), response.damping()))
    response.destroy()
    solution.destroy()
    # In the axes of the source: y along the load, x a quarter of a turn behind.
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    K, C = turn.T @ K @ turn, turn.T @ C @ turn
    assert sorted(np.abs(K).ravel() / 1e6) == pytest.approx(sorted([12.81, 16.39, 25.06, 8.815]), rel=1e-3)
    assert sorted(np.abs(C).ravel() / 1e3) == pytest.approx(sorted([232.9, 81.92, 81.92, 294.9]), rel=1e-3)
    assert K[0, 1] * K[1, 0] < 0 and C[0, 1] == pytest.approx(C[1, 0], rel=1e-3)


@pytest.mark.parametrize(
    "row", list(csv.DictReader(TABLE.read_text().splitlines())), ids=lambda row: f"{row['eps']}-{row['B_over_D']}"
)
def test_a_journal_that_is_squeezed(row):
    """Butenschoen's So = P psi^2/(B D eta |eps'|) of a journal that moves along its eccentricity, by one short step."""
    eps, B = float(row["eps"]), 0.1 * float(row["B_over_D"])
    scene = load_scene(
        {
            "family": "bearing", "dimension": 2, "L": 0.1 * math.pi, "width": B, "U": 0.0, "nx": 180, "ny": 23, "p_unit": 1e5,
            "fluid": {"mu": 0.02}, "sides": {"west": "periodic", "east": "periodic"},
            "film": {"shape": "journal", "c": 1e-4, "eccentricity": eps, "widest": 0.05 * math.pi},
            "motion": {"t_end": 2e-6, "steps": 2, "scheme": "euler", "journal": [f"{eps} + t", "0"]},
        }
    )  # fmt: skip
    solution = solve(scene)
    So = solution.load * (1e-4 / 0.05) ** 2 / (B * 0.1 * 0.02)
    solution.destroy()
    assert So == pytest.approx(float(row["So"]), rel=0.01)


def test_time_steps_answer_as_the_linearisation_says():
    """Where film forms again inside: forces of a journal that moves a little, K + i nu C at nu = omega, void stored."""
    nx, amplitude, steps, turns = 60, 1e-5, 160, 4
    data = {
        "family": "bearing", "dimension": 2, "L": 0.1 * math.pi, "width": 0.05, "nx": nx, "ny": 5, "fluid": {"mu": 0.02},
        "film": {"shape": "journal", "c": 1e-4, "eccentricity": 0.6, "widest": 0.0},
        "sides": {"west": "periodic", "east": "periodic", "south": 1e5, "north": 1e5}, "U": 5.0,
    }  # fmt: skip
    nu = 5.0 / 0.05
    scene = load_scene(data)
    with solve(scene, method="active-set") as steady:
        force = np.array(steady.problem.quantities(steady.fields)["force"])
        along = math.atan2(-force[1], -force[0])
        (one,) = coefficients(scene, steady, [nu])
    turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    Z = turn @ (one.K + 1j * nu * one.C) @ turn.T
    T = 2 * math.pi / nu
    motion = {"t_end": turns * T, "steps": turns * steps, "journal": [f"-0.6 + {amplitude}*sin({nu!r}*t)", "0"]}
    solution = solve(load_scene({**data, "motion": motion}), method="active-set")
    assert solution.converged
    rows = solution.history[-steps:]
    t = np.array([row["t"] for row in rows])
    F = np.array([[row["force_x"], row["force_y"]] for row in rows])
    solution.destroy()
    # F = F_0 - Im(Z e exp(i nu t)) in the first harmonic.
    basis = np.stack([np.ones_like(t), np.sin(nu * t), np.cos(nu * t)], axis=1)
    _, sine, cosine = np.linalg.lstsq(basis, F, rcond=None)[0]
    seen = -(sine + 1j * cosine) / (amplitude * 1e-4)
    assert np.abs(seen - Z[:, 0]).max() <= 5e-4 * np.abs(Z).max()


def test_both_thresholds_of_lund_and_thomsen():
    """2.35 for L/D = 0.5, S = 1.656, and 2.10 for L/D = 1, by our own coefficients."""
    for changes, expected in (
        ({"L_over_D": 0.5, "eccentricity": 0.244}, 2.35),
        ({"L_over_D": 1.0, "eccentricity": 0.15}, 2.10),
    ):
        scene = load_scene("two_groove_journal", n=180, **changes)
        with solve(scene) as solution:
            (one,) = coefficients(scene, solution)
            scale = scene.clearance / solution.load
        _, threshold = stability(one.K * scale, one.C * scale * scene.omega)
        assert threshold == pytest.approx(expected, rel=0.03)
