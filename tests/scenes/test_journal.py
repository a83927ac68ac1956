"""Journal bearings against the exact long bearing and Butenschoen's tables of the finite one."""

import pytest

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.scenes.scene import load_scene


def numbers(name, changes):
    solution = solve(load_scene(name, changes))
    assert solution.converged, solution.message
    values = solution.problem.quantities(solution.fields) | {"r_max": solution.problem.reduce.max(solution.fields["r"])}
    solution.destroy()
    return values


def test_long_bearing():
    """eps = 0.5: So 3.22777817, attitude 58.296185 deg, rupture 219.69402 deg, P_max 4.47498820 (exact)."""
    values = numbers("long_journal", {"n": 1000})
    assert values["sommerfeld"] == pytest.approx(3.22777817, rel=1e-5)
    assert values["attitude_deg"] == pytest.approx(58.296185, rel=1e-5)
    assert values["p_max"] / values["p_unit"] == pytest.approx(4.47498820, rel=1e-5)
    length = load_scene("long_journal").L
    assert values["rupture"] / length * 360 == pytest.approx(219.69402, abs=2e-3)


@pytest.mark.parametrize("n", [100, 200, 400])
@pytest.mark.parametrize("eccentricity", [0.1, 0.5, 0.9, 0.99])
def test_long_bearing_load_and_exact_solution(n, eccentricity):
    scene = load_scene("long_journal", {"n": n, "eccentricity": eccentricity})
    values = numbers("long_journal", {"n": n, "eccentricity": eccentricity})
    error = abs(values["pressure_integral"] / scene.exact().load - 1)
    assert error < 30 / n**2 / (1 - eccentricity) ** 1.5


@pytest.mark.parametrize("ratio, sommerfeld, attitude, leakage", [(1.0, 0.8903, 56.705, 0.7852), (0.5, 0.3124, 54.993, 0.4694)])
def test_finite_bearing_butenschoen(ratio, sommerfeld, attitude, leakage):
    """eps = 0.5, within 0.5 % of the table."""
    values = numbers("journal", {"nx": 239, "ny": 39, "width_over_diameter": ratio})
    assert values["sommerfeld"] == pytest.approx(sommerfeld, rel=5e-3)
    assert values["attitude_deg"] == pytest.approx(attitude, rel=5e-3)
    assert values["side_leakage_number"] == pytest.approx(leakage, rel=5e-3)


def test_finite_bearing_jfo_run():
    """Another code on 720 x 80: P_max 1.97558, max r 0.65874."""
    values = numbers("journal", {"nx": 359, "ny": 59})
    assert values["p_max"] / values["p_unit"] == pytest.approx(1.97558, rel=1e-3)
    assert values["r_max"] == pytest.approx(0.65874, rel=5e-3)


def test_numbers_do_not_depend_on_the_scale():
    small = numbers("journal", {"nx": 59, "ny": 15})
    large = numbers("journal", {"nx": 59, "ny": 15, "D": 0.7, "omega": 12.0, "mu": 0.2, "psi": 2e-3})
    for key in ("sommerfeld", "attitude_deg", "side_leakage_number", "cavitated_fraction"):
        assert large[key] == pytest.approx(small[key], rel=1e-9)


@pytest.mark.parametrize(
    "changes, message",
    [({"eccentricity": 1.0}, "eccentricity"), ({"L": 2.0}, "follows from"), ({"psi": 0}, "psi"), ({"D": "wide"}, "D = wide")],
)
def test_bad_input(changes, message):
    with pytest.raises(InputError, match=message):
        load_scene("journal", changes)
