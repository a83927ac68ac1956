"""Bearings against the figures of others: high eccentricities, a groove of finite extent, the best step."""

import csv
from pathlib import Path

import pytest
from scipy.optimize import minimize

from lcp_lube import solve

PUBLISHED = Path(__file__).parents[2] / "benchmarks" / "published"


def rows():
    """Butenschoen's complete rows at 0.995 and 0.999."""
    with (PUBLISHED / "bearings" / "butenschoen.csv").open() as file:
        for row in csv.DictReader(file):
            if row["eps"] in ("0.995", "0.999") and row["B_over_D"] in ("1", "1/2", "1/4"):
                over, _, under = row["B_over_D"].partition("/")
                yield float(row["eps"]), float(over) / float(under or 1), *(float(row[k]) for k in ("So", "attitude_deg", "Q"))


@pytest.mark.parametrize(("eps", "ratio", "So", "attitude", "Q"), list(rows()))
def test_butenschoen_at_high_eccentricity(eps, ratio, So, attitude, Q):
    """Sommerfeld number, attitude angle and side leakage to 0.5 %, on lines graded towards the thinnest film."""
    keys = {"eccentricity": eps, "width_over_diameter": ratio, "graded": True, "nx": 119, "ny": 29}
    with solve("journal", **keys) as solution:
        values = solution.problem.quantities(solution.fields)
    assert solution.converged
    assert values["sommerfeld"] == pytest.approx(So, rel=5e-3)
    assert values["attitude_deg"] == pytest.approx(attitude, rel=5e-3)
    assert values["side_leakage_number"] == pytest.approx(Q, rel=5e-3)


def test_pfeil_journal_with_one_groove():
    """d 0.1, B 0.08 m, c 150 um, a groove of 15 degrees x 60 mm at 70 kPa, 90 degrees behind the thinnest film, 3000 rpm, 0.01
    Pa s, eps 0.5: F 1745 N, p_max 525.3 kPa, torque on the bush 1.379 N m; the supply's flow is printed to two digits, 6.8e-5.

    The torque on the bush is that on the journal less the moment of the force, e F sin(attitude)."""
    groove = {"shape": "axial_groove", "angle_deg": 90.0, "extent_deg": 15.0, "length_mm": 60, "p": 7e4}
    scene = {"family": "grooved_journal", "D": 0.1, "L_over_D": 0.8, "clearance_um": 150, "speed_rpm": 3000.0, "mu": 0.01}
    keys = {"eccentricity": 0.5, "attitude_deg": 0.0, "grooves_deg": [], "supply": [groove], "nx": 192, "ny": 51}
    with solve({**scene, **keys}) as solution:
        values = solution.problem.quantities(solution.fields)
    bush = 0.05 * values["friction"] - 0.5 * 150e-6 * abs(
        values["force"][1]
    )  # the force's moment about the journal is the rest
    assert values["load"] == pytest.approx(1745.0, rel=3e-3)
    assert values["p_max"] == pytest.approx(525.3e3, rel=3e-3)
    assert bush == pytest.approx(1.379, rel=3e-3)
    assert values["supply_flow"][0] == pytest.approx(6.8e-5, rel=0.05 / 6.8 + 3e-3)


def test_rayleighs_best_step():
    """Of all steps the one at 0.718 of the length, of film ratio 1 + sqrt(3)/2, carries most: 0.2063 mu U L^2/h^2."""
    L, h, mu, U = 0.1, 2e-5, 0.01, 2.0

    def load(x):
        film = [{"shape": "constant", "h": h}, {"shape": "pocket", "depth": h * (x[0] - 1.0), "x": [-L, x[1] * L]}]
        with solve({"family": "bearing", "L": L, "U": U, "n": 1999, "fluid": {"mu": mu}, "film": film}) as solution:
            return -solution.problem.quantities(solution.fields)["load"] * h**2 / (mu * U * L**2)

    best = minimize(load, [1.7, 0.6], method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-9})
    assert best.x == pytest.approx([1.0 + 3**0.5 / 2.0, 0.7182], rel=1e-3)
    assert -best.fun == pytest.approx(0.2063, rel=1e-3)
