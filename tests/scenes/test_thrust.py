"""Sectors in polar coordinates: exact flows, torques and areas of a ring, the plane slider as their limit, order, bad input."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, solve

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from slanted_edges import muijderman, narrow_grooves

MU, H = 0.03, 2.5e-5
RING = {"family": "thrust", "D_inner": 0.06, "D_outer": 0.12, "pads": 6, "profile": "flat", "h_min": H, "mu": MU}
SMALL = {"nx": 39, "ny": 19}


def numbers(scene, **keys):
    with solve(scene, **keys) as solution:
        assert solution.converged, solution.message
        return solution.problem.quantities(solution.fields)


def test_flow_of_a_ring_between_two_pressures():
    """Q = pi h^3 dp/(6 mu log(r_o/r_i)), p a logarithm: of second order."""
    exact = math.pi * H**3 * 1e6 / (6 * MU * math.log(2.0))
    off = []
    for ny in (9, 19, 39):
        values = numbers({**RING, "p_inner": 1e6, "nx": 12, "ny": ny})
        assert values["inner_flow"] == pytest.approx(-values["outer_flow"], rel=1e-9)
        off.append(abs(values["outer_flow"] / exact - 1))
    assert off[-1] < 2e-4 and off[0] / off[1] > 3.5 and off[1] / off[2] > 3.5


def test_torque_and_area_of_a_full_film():
    """T = pi mu omega (r_o^4 - r_i^4)/(2 h); a pressure that is the same everywhere acts on the area and carries nothing."""
    values = numbers({**RING, "p_inner": 2e5, "p_outer": 2e5, "speed_rpm": 1000.0, "nx": 12, "ny": 39})
    omega = 2 * math.pi * 1000 / 60
    torque = math.pi * MU * omega * (0.06**4 - 0.03**4) / (2 * H)
    assert values["friction_torque"] == pytest.approx(torque, rel=1e-3)
    assert values["power_loss"] == pytest.approx(values["friction_torque"] * omega, rel=1e-12)
    assert values["pressure_integral"] == pytest.approx(2e5 * math.pi * (0.06**2 - 0.03**2), rel=1e-9)
    assert abs(values["load"]) < 1e-9 * values["pressure_integral"]


@pytest.mark.parametrize("profile", ["tapered_land", "step"])
def test_far_from_the_centre_it_is_a_plane_slider(profile):
    """1000 widths from the centre a sector is a rectangle: load, drag and flows to 1e-3."""
    L, width, R, speed = 0.05, 0.03, 30.0, 10.0
    pads = round(2 * math.pi * R / L / 1.2)
    keys = {"taper": 4e-5, "taper_part": 0.6, "p_groove": 1e5, "p_inner": 1e5, "p_outer": 1e5}
    scene = {
        **RING,
        **keys,
        **SMALL,
        "D_inner": 2 * R - width,
        "D_outer": 2 * R + width,
        "pads": pads,
        "pad_deg": math.degrees(L / R),
        "speed_rpm": speed / R * 60 / (2 * math.pi),
        "profile": profile,
    }
    taper = {"shape": "linear", "h_start": 4e-5, "h_end": 0.0, "between": [0.0, 0.6 * L]}
    step = {"shape": "pocket", "depth": 4e-5, "x": [-1.0, 0.6 * L]}
    film = [{"shape": "constant", "h": H}, taper if profile == "tapered_land" else step]
    plane = {"family": "bearing", "dimension": 2, "L": L, "width": width, "U": speed, "film": film, **SMALL}
    plane["fluid"] = {"mu": MU, "p_supply": 1e5}
    sector, slider = numbers(scene), numbers(plane)
    assert sector["pad_load"] == pytest.approx(slider["load"], rel=1e-3)
    assert sector["friction_torque"] / R / pads == pytest.approx(slider["friction"], rel=1e-3)
    for side, flow in slider["flow"].items():
        assert sector["flow"][side] / pads == pytest.approx(flow, rel=1e-3, abs=1e-3 * max(map(abs, slider["flow"].values())))


def test_tapered_land_converges_with_second_order():
    found = [numbers("tapered_land", nx=n, ny=n // 2) for n in (31, 63, 127)]
    for key in ("load", "friction_torque"):
        first, second = np.abs(np.diff([one[key] for one in found]))
        assert first / second > 3.0
    assert abs(sum(found[0]["flow"].values())) < 1e-12 * max(found[0]["flow"].values())


def test_where_the_load_acts():
    """Behind the middle of the pad, and where its moments about the centre put it."""
    values = numbers("tapered_land", **SMALL)
    radius, angle = values["pressure_centre"]
    assert 0.03 < radius < 0.06 and 25.0 < angle < 45.0
    place = np.array([math.sin(math.radians(angle)), -math.cos(math.radians(angle))]) * radius * values["pad_load"]
    assert values["moment"] == pytest.approx(place, rel=1e-9)


def test_spirals_pump_inwards_and_outwards():
    inwards = numbers("spiral_groove", nx=40, ny=39)
    assert inwards["load"] > 0 and inwards["p_max"] > 1e6
    outwards = numbers("spiral_groove", nx=40, ny=39, angle_deg=-16.0, p_inner=5e5, p_outer=5e5)
    assert outwards["load"] < inwards["load"]


@pytest.mark.parametrize("shape, off", [(0.37, 5e-3), (1.0, 6e-3), (2.2, 5e-3)])
def test_many_spirals_are_the_narrow_groove_theory(shape, off):
    """An error of first order in one over the number of grooves, extrapolated: 0.5 %, that of the grid with it, on cells of any
    shape. An edge moves on by `shape` rows a column: by just one it lies everywhere alike, which a mean over places is not."""
    found = {}
    for grooves in (30, 60):
        nx = 24
        ny = round(shape * nx * grooves * 0.015 / (2 * math.pi * 0.0225 * math.tan(math.radians(16))))
        values = numbers("spiral_groove", pads=grooves, p_inner=1e6, p_outer=1e6, nx=nx, ny=ny)
        found[grooves] = np.array([values["load"], values["inner_flow"]])
    theory = np.array(narrow_grooves(1e-5, 2e-5, math.radians(16), 0.6, (0.015, 0.019, 0.03)))
    assert 2 * found[60] - found[30] == pytest.approx(np.abs(theory), rel=off)


@pytest.mark.parametrize("rows", [0.87, 1.15])
@pytest.mark.parametrize("angle", [20.0, 45.0])
def test_many_grooves_of_a_herringbone_are_the_narrow_groove_theory(angle, rows):
    """Pressure rises to the middle of the width along straight lines; pitches of 1/32 and 1/64 of it, extrapolated: 0.5 % with
    12 points a groove and land, 2 % with the film at the faces' middle. rows : rows by which an edge moves on by a column."""
    width, film, depth, mu, U, nx = 0.04, 1e-5, 2e-5, 0.01, 10.0, 12
    found = {}
    for grooves in (32, 64):
        L = width / grooves
        groove = {"shape": "herringbone", "depth": depth, "count": 1, "angle_deg": angle, "ratio": 0.5}
        scene = {"family": "bearing", "dimension": 2, "L": L, "width": width, "U": U, "nx": nx}
        scene |= {"ny": round(rows * nx * grooves / math.tan(math.radians(angle))), "scheme": "face"}
        scene |= {"film": [{"shape": "constant", "h": film}, groove], "fluid": {"mu": mu, "p_supply": 1e6}}
        found[grooves] = numbers({**scene, "sides": {"west": "periodic", "east": "periodic"}})["load"] / L
    rise = 6 * mu * U * muijderman(film / (film + depth), math.radians(angle), 0.5) / film**2
    assert 2 * found[64] - found[32] == pytest.approx(rise * width**2 / 4, rel=5e-3)


@pytest.mark.parametrize("method", ["active-set", "din", "fas", "monotone"])
def test_methods_agree(method):
    reference = numbers("tapered_land", **SMALL)["load"]
    with solve("tapered_land", **SMALL, method=method) as solution:
        assert solution.problem.quantities(solution.fields)["load"] == pytest.approx(reference, rel=1e-7)


def test_balance_is_about_the_whole_bearing():
    with solve(load_scene("tapered_land", {**SMALL, "balance.load": 2e4})) as solution:
        values = solution.problem.quantities(solution.fields)
    assert values["load"] == pytest.approx(2e4, rel=1e-6) and values["pad_load"] == pytest.approx(2e4 / 6, rel=1e-6)


def test_recess_in_every_pad():
    recess = {"shape": "rectangle", "x_mm": [10, 20], "y_mm": [10, 20], "restrictor": "capillary", "K": 1e-12, "p_s": 5e6}
    values = numbers("tapered_land", **SMALL, supply=[recess])
    flows = [*values["supply_flow"], *(-flow for flow in values["flow"].values())]
    assert abs(sum(flows)) < 1e-10 * max(map(abs, flows))
    assert values["supply_flow"][0] == pytest.approx(6 * 1e-12 * (5e6 - values["supply_p"][0]), rel=1e-9)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"pads": 8}, "pads overlap; 45 deg at most"),
        ({"D_inner": 0.2}, "less than D_outer"),
        ({"profile": "spiral"}, "neither pad_deg nor angle_deg = 0"),
        ({"pad_deg": None}, "pad_deg is missing"),
        ({"h_min": 0.0}, "h_min"),
    ],
)
def test_bad_input(keys, words):
    with pytest.raises(InputError) as error:
        solve("tapered_land", **keys)
    assert words in str(error.value)
