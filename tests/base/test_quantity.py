"""Numbers with units: what they mean, where they may stand, what is refused."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene
from lcp_lube.base.quantity import SYMBOLS, in_si, quantity
from lcp_lube.scenes.scene import parse_changes


@pytest.mark.parametrize(
    "text, units, value",
    [
        ("15um", "m", 15e-6),
        ("15 \u00b5m", "m", 15e-6),
        ("2.5 \u03bcm", "m", 2.5e-6),
        ("1 MPa", "Pa", 1e6),
        ("1.5bar", "Pa", 1.5e5),
        ("5 N/mm2", "Pa", 5e6),
        ("5 N/mm\u00b2", "Pa", 5e6),
        ("3000 rpm", "rad/s", 100 * math.pi),
        ("40 mPa s", "Pa s", 0.04),
        ("40 mPa.s", "Pa s", 0.04),
        ("40 mPas", "Pa s", 0.04),
        ("40cP", "Pa s", 0.04),
        ("36 km/h", "m/s", 10.0),
        ("20 1/GPa", "1/Pa", 2e-8),
        ("20 GPa^-1", "1/Pa", 2e-8),
        ("5 kN", "N or N/m", 5e3),
        ("5 N/mm", "N or N/m", 5e3),
        ("90 deg", "rad", math.pi / 2),
        ("75%", "", 0.75),
        ("1e3", "", 1000.0),
        (".75", "m", 0.75),
        ("-7.", "Pa", -7.0),
    ],
)
def test_values(text, units, value):
    assert in_si(text, units) == value


@pytest.mark.parametrize("text", ["", "um", "inf", "nan", "closed", "x + 1", "\u0663 um", "--1"])
def test_no_number(text):
    assert quantity(text) is None and in_si(text, "m") is None


@pytest.mark.parametrize(
    "text, units, message",
    [
        ("15um", "Pa", "a pressure (Pa, kPa, MPa, GPa, bar) is needed, not a length"),
        ("50 1/s", "rad/s", "an angular velocity (rad/s, rpm) is needed"),
        ("1 kPa", "N or N/m", "a force (N, kN) or a force per width (N/m, kN/m) is needed, not a pressure"),
        ("1%", "m", "a length (m, mm, um, nm) is needed"),
        ("5 m", "", "a number without a unit is needed, not a length"),
        ("5 kPa", "rad/s2", "a value in s^-2 rad^1 is needed, not a pressure"),
        ("12 MPA", "Pa", "'MPA' is no unit; nearest is MPa"),
        ("1_000", "m", "'_000' is no unit"),
        ("1/2", "m", "'/2' is no unit"),
    ],
)
def test_refused(text, units, message):
    with pytest.raises(InputError) as caught:
        in_si(text, units)
    assert str(caught.value) == message


@pytest.mark.parametrize("text", ["1e99999999999 um", "1e-99999999999 um", "1" * 5000 + " m", "1e308 km"])
def test_out_of_range_is_quick(text):
    assert quantity(text).value in (0.0, math.inf)


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from([*SYMBOLS]))
def test_base_units_say_the_same(number, symbol):
    found = quantity(f"{number!r} {symbol}")
    assume(math.isfinite(found.value))
    again = quantity(found.text)
    assert (again.value, again.dimension) == (found.value, found.dimension)
    assume(abs(number) > 1e-300)
    assert found.value == pytest.approx(number * quantity(f"1 {symbol}").value, rel=1e-15)


@given(st.text(max_size=12))
def test_any_text_is_a_quantity_or_refused(text):
    for tail in (text, f"1{text}", f"1 {text}"):
        try:
            found = quantity(tail)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert found is None or len(found.dimension) == 5


@pytest.mark.parametrize(
    "scene, given, plain",
    [
        ("problem1", ["h_min=10 um", "n=1e2", "p_a=1bar", "wave=[10%, .9]"], {"h_min": 1e-5, "p_a": 1e5, "wave": [0.1, 0.9]}),
        ("problem1", ["h_min_um=10"], {"h_min": 1e-5}),
        ("journal", ["D=20cm", "omega=3000 rpm", "eccentricity=75%"], {"D": 0.2, "omega": 100 * math.pi, "eccentricity": 0.75}),
        ("textured_slider", ["K=1e1", "depth=2um"], {"K": 10, "depth": 2e-6}),
        (
            "two_groove_journal",
            ["speed_rpm=50 rev/s", "groove_deg=30 deg", "grooves_deg=[90 deg, 270 deg]"],
            {"speed_rpm": 3000.0, "groove_deg": 30.0, "grooves_deg": [90.0, 270.0]},
        ),
        (
            "pocketed_pad",
            ["film.pocket.x=[2.5mm, 5mm]", "sides.west=2 bar", "fluid.mu=10cP", "balance.load=5 kN/m"],
            {"film.pocket.x": [2.5e-3, 5e-3], "sides.west.p": 2e5, "fluid.mu": 0.01, "balance.load": 5000.0},
        ),
        ("squeeze", ["steps=1e2"], {"steps": 100}),
        ("ehl_line", ["lambda=.5"], {"lambda": 0.5}),
    ],
)
def test_scenes_with_units(scene, given, plain):
    assert load_scene(scene, parse_changes(given)) == load_scene(scene, plain)


def test_files_with_units(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text(
        """family = "bearing"\nL = "10 mm"\nU = "36 km/h"\nfluid = {mu = "10 mPa s"}\nsides = {west = "1 bar", east = "closed"}
        film = {shape = "journal", c = "50um", eccentricity = "60%"}\n"""
    )
    scene = load_scene(file)
    assert (scene.L, scene.U, scene.fluid.mu, scene.sides.west.p, scene.sides.east.kind) == (0.01, 10.0, 0.01, 1e5, "closed")
    assert (scene.film[0].c, scene.film[0].eccentricity) == (5e-5, 0.6)
    # One [film] is addressed as one of several would be.
    for key in ("film.journal.eccentricity", "film.1.eccentricity", "film.eccentricity"):
        assert load_scene(file, {key: 0.7}).film[0].eccentricity == 0.7
    with pytest.raises(InputError, match="nearest is eccentricity"):
        load_scene(file, {"film.journal.eccentrcity": 0.7})


def test_data_in_si():
    scene = load_scene("pocketed_pad", {"film.pocket.depth": "2um", "balance": {"load": "5 N/mm"}})
    data, units = scene.data_si(), scene.data_units()
    assert (data["L"], data["film"][1]["depth"], data["fluid"]["p_supply"]) == (0.01, 2e-6, 1e5)
    assert units["L"] == units["film.2.depth"] == "m" and units["fluid.mu"] == "Pa s" and units["balance.load"] == "N/m"
    assert "n" not in units and data["family"] == "bearing" and "name" not in data
    same = load_scene(data)
    assert same.data_si() == data
