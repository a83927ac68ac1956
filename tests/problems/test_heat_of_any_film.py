"""Power in is heat out on films nobody tuned: any speed, oil, thickness, sides, exchange with the walls, 1D and 2D."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import solve
from lcp_lube.problems.film import oils

POWERS = st.floats(-1.0, 1.0)
KINDS = ("pressure", "closed", "periodic", "symmetry")


@st.composite
def films(draw):
    """A bearing's data."""
    h = 3e-5 * 10 ** draw(POWERS)
    data = {
        **{"family": "bearing", "L": 0.1, "U": draw(st.sampled_from([-1, 1])) * 10 ** draw(st.floats(-2, 2))},
        **{"n": draw(st.integers(1, 40)), "fluid": {"p_supply": 1e5 * 10 ** draw(POWERS)}},
    }
    shapes = ({"shape": "linear", "h_start": h, "h_end": 3 * h}, {"shape": "linear", "h_start": 4 * h, "h_end": h})
    data["film"] = draw(st.sampled_from([*shapes, {"shape": "sinusoid", "h_min": h, "h_max": 2.5 * h}]))
    if draw(st.booleans()):
        data |= {"dimension": 2, "width": 0.06, "nx": draw(st.integers(3, 16)), "ny": draw(st.integers(1, 7))}
        del data["n"]
        data["sides"] = {"south": draw(st.sampled_from(["pressure", "symmetry"]))}
        if data["film"]["shape"] == "sinusoid" and draw(st.booleans()):
            data["sides"] |= {"west": "periodic", "east": "periodic"}
        elif draw(st.booleans()):
            data["sides"][draw(st.sampled_from(["east", "west"]))] = "closed"
    heat = {"T_in": 320.0, "specific_heat": 2000.0, "exchange": draw(st.sampled_from([0.0, 10.0, 1e3, 1e6]))}
    heat |= {"model": draw(st.sampled_from(["energy", "energy", "effective"]))}
    heat |= draw(st.sampled_from([{"oil": "ISO VG 10"}, {"oil": "ISO VG 680"}, {"beta": 0.0}, {"beta": 0.06}]))
    data["fluid"] |= {} if "oil" in heat else {"mu": 0.02 * 10 ** draw(POWERS)}
    return {**data, "temperature": heat}


@settings(max_examples=30)
@given(films())
def test_power_in_is_heat_out(data):
    with solve(data, model="full") as s:
        measures = s.certificate.measures
        if not s.converged:  # the reason is one of the two that there are
            assert s.outcome in ("no_solution", "max_iterations"), s.message
            assert s.outcome != "no_solution" or "no steady temperature" in s.message
            return
        assert measures["heat_defect"] < 1e-8 and measures["coupling"] < 1e-8 and measures["energy_residual"] < 1e-8
        assert s.heat_out == pytest.approx(s.heat_power, rel=1e-8, abs=1e-12)
        assert s.temperature_effective > 319.99 and s.temperature_max <= oils.HIGHEST


def test_oil_that_flows_back_from_a_supply():
    """Between wall and supply oil hardly moves, gets hot and thin, and then flows the other way: from cold oil on the loop's
    steps lead nowhere, and from warmer oil to an answer whose equations hold."""
    L, W = 0.1167, 0.092
    pad = {"family": "bearing", "dimension": 2, "L": L, "width": W, "U": 10.7, "nx": 17, "ny": 9}
    pad |= {"film": [{"shape": "linear", "h_start": 8.2465e-5, "h_end": 3.7484e-5}], "fluid": {"p_supply": 1.45e6}}
    pad |= {"supply": [{"x": [0.1 * L, 0.25 * L], "y": [0.3 * W, 0.7 * W], "p": 4.36e6}]}
    heat = {"T_in": 317.3, "law": "exponential", "T": [313.15, 353.15], "mu": [0.05334, 0.01362]}
    with solve({**pad, "temperature": heat, "shear": {"law": "eyring", "tau_0": 5448}}, model="full") as s:
        assert s.converged, s.message
        assert s.certificate.measures["coupling"] <= 1e-9 and s.certificate.measures["energy_residual"] <= 1e-9
        assert any("from oil of 1/e of the viscosity" in one for one in s.settings["why"])


def test_behind_a_closed_inlet():
    """Oil that the wall drags from a front is pressed back to it where no more arrives: net nothing flows there, and its heat
    goes with what turns round. Cells without oil have no temperature."""
    pad = {"family": "bearing", "dimension": 2, "L": 0.1, "width": 0.05, "U": 2.0, "nx": 31, "ny": 13}
    pad |= {"film": [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}], "fluid": {"mu": 0.05, "p_supply": 1e5}}
    pad |= {"sides": {"west": "closed"}, "temperature": {"T_in": 320.0, "beta": 0.02}}
    with solve(pad, model="full") as s:
        assert s.converged and s.settings["details"]["fluid_solves"] < 30, s.message
        assert s.fields["r"].max() > 1.0 - 1e-9 and s.temperature_max < 500.0
        assert s.certificate.measures["heat_defect"] < 1e-8 and s.certificate.measures["energy_residual"] < 1e-9
    line = {key: value for key, value in pad.items() if key not in ("dimension", "width", "nx", "ny")} | {"n": 40}
    line["fluid"] = {"mu": 0.05, "p_supply": 1e8}  # full
    with solve(line, model="full") as s:
        assert s.outcome == "no_solution" and "does not flow" in s.message


@pytest.mark.parametrize("pocket", [{"x_mm": [3.05, 4.44], "y_mm": [1.34, 2.82]}, None])
def test_dry_films_behind_a_closed_side(pocket):
    """What a pocket's wall cuts holds no oil either, so nothing shears it; heat of no oil at all is rounding."""
    film = [{"shape": "linear", "h_start": 6.5e-6, "h_end": 3.9e-6 if pocket else 9e-6}]
    film += [{"shape": "pocket", "depth": 2.5e-6, **pocket}] if pocket else []
    data = {"family": "bearing", "dimension": 2, "L_mm": 6.28, "width_mm": 4.59, "U": 7.4, "nx": 27, "ny": 12, "film": film}
    data |= {"fluid": {"mu": 0.033, "p_supply": 1e5 if pocket else 0.0}, "sides": {"west": "closed"}}
    with solve({**data, "temperature": {"beta": 0.03}}, model="full") as s:
        assert s.converged and s.certificate.measures["heat_defect"] < 1e-8
        assert s.heat_out == pytest.approx(s.heat_power, rel=1e-8, abs=1e-12) and (s.heat_power > 1e-3) == bool(pocket)


def test_roundings_of_void_are_no_front():
    """DIN leaves some 1e-9 of void in full cells: oil turns round at fronts, not there (0.4 % of the load, 0.35 K)."""
    data = {"family": "bearing", "L": 6.5e-3, "U": 14.0, "n": 3, "scheme": "face", "fluid": {"mu": 6e-3}}
    data |= {"film": {"shape": "journal", "c": 8e-5, "eccentricity": 0.7}, "sides": {"west": 3e3, "east": 1.6e5}}
    loads = []
    for method in ("active-set", "din"):
        with solve({**data, "temperature": {"model": "energy", "beta": 0.018}}, method=method, model="full") as s:
            assert s.converged and s.cavitated_fraction == 0.0
            loads.append(s.load)
    assert loads[0] == pytest.approx(loads[1], rel=1e-7)
