"""Effects in every family of films: heat balances, constant fields that change nothing, numbers of the whole bearing, ranks."""

import pytest

from lcp_lube import InputError, load_scene, solve

EYRING = {"law": "eyring", "tau_0": 1e6}

FLAT = {"family": "thrust", "profile": "flat", "pad_deg": 50.0}
WARM = {"beta": 0.03, "T_in": 320.0}
SMALL = {
    "tapered_land": {"nx": 24, "ny": 11},
    "spiral_groove": {"nx": 24, "ny": 12},
    "tilting_pad_thrust": {"nx": 19, "ny": 9},
    "tilting_pad_journal": {"nx": 60, "ny": 5},
    "misaligned_journal": {"nx": 72, "ny": 6},
    "hybrid_journal": {"nx": 48, "ny": 12},
    "herringbone_journal": {"nx": 48, "ny": 12},
    "ring_journal": {"nx": 48, "ny": 9},
    "journal": {"nx": 40, "ny": 9},
    "problem1": {"n": 60},
    "problem4": {"nx": 30, "ny": 12},
    "textured_slider": {"nx": 40, "ny": 16},
}


@pytest.mark.parametrize("name", SMALL)
def test_heat(name):
    """Power in is heat out, hotter oil carries less, and what is told is of the whole bearing."""
    scene = load_scene(name, SMALL[name])
    with solve(scene) as cold, solve(load_scene(name, {**SMALL[name], "temperature": WARM}), model="full") as s:
        assert s.converged, s.message
        assert s.certificate.measures["heat_defect"] < 1e-8 and s.certificate.measures["coupling"] < 1e-8
        assert s.heat_out == pytest.approx(s.heat_power, rel=1e-8) and s.temperature_max > 320.0
        if "balance" not in cold.settings:
            assert s.power_loss < cold.power_loss
        grooved = name in ("tilting_pad_journal", "misaligned_journal", "hybrid_journal")
        assert 0.6 * s.power_loss < s.heat_power < 1.05 * s.power_loss or grooved
        assert set(cold.numbers) < set(s.numbers)


@pytest.mark.parametrize("name", ["tapered_land", "hybrid_journal", "journal", "problem4"])
def test_a_factor_of_the_viscosity_is_a_viscosity(name):
    """By place, but the same everywhere: the film of that viscosity."""
    factor, thicker = ({**SMALL[name], **more} for more in ({"viscosity.factor": "1.5"}, {"mu": 1.5 * load_scene(name).mu}))
    with solve(load_scene(name, factor), model="full") as a, solve(load_scene(name, thicker)) as b:
        assert a.converged and a.load == pytest.approx(b.load, rel=1e-7)
        assert a.friction == pytest.approx(b.friction, rel=1e-7)


def test_a_sector_is_heated_by_its_radius():
    """Flat, no pressure: each arc of radius R turns mu (omega R)^2/h into heat, and all of it is the power lost."""
    with solve({**FLAT, "nx": 20, "ny": 10, "temperature": {"beta": 0.0}}, model="full") as s:
        assert s.heat_power == pytest.approx(s.power_loss, rel=1e-12)
        assert s.heat_out == pytest.approx(s.heat_power, rel=1e-10)


def test_shear_by_the_radius():
    """The outer radius thins more: Eyring's stress there is that of its own speed."""
    flat = {**FLAT, "nx": 9, "ny": 9}
    with solve({**flat, "shear": {"law": "eyring", "tau_0": 2e3}}, model="full") as s, solve(flat) as plain:
        assert 0.3 * plain.friction_torque < s.friction_torque < 0.9 * plain.friction_torque


def test_mu_once():
    with pytest.raises(InputError, match=r"mu = 0.03 and the viscosities of \[temperature\] are both given"):
        load_scene("tapered_land", {"mu": 0.03, "temperature": {"oil": "ISO VG 32"}})


def test_a_nodal_scheme_has_no_lift():
    with pytest.raises(InputError, match="scheme = nodal: an effect on lift needs scheme = face"):
        solve(load_scene("problem1", {"n": 30, "elastic": {"compliance": 1e-13}}))


def test_on_ranks(cli):
    name = "tapered_land"
    words = ["solve", name, "--json", "--model", "full"]
    words += [word for key, value in {**SMALL[name], "temperature.beta": 0.03}.items() for word in ("--set", f"{key}={value}")]
    alone, three = cli(*words), cli(*words, ranks=3)
    assert alone.status == three.status == 0, three.err
    for key in ("load", "power_loss", "temperature_max", "heat_out"):
        assert three.json[key] == pytest.approx(alone.json[key], rel=1e-6)


@pytest.mark.parametrize("ny", [8, 9])
def test_half_of_a_film_between_grooves_has_its_effects(ny):
    """A weak effect above all: half a film without it would pass as the whole's answer."""
    scene = load_scene("two_groove_journal", {"nx": 45, "ny": ny, "attitude_deg": 40.0, "p_end": 1e5, "shear": EYRING})
    half, whole = (solve(scene, model="full", reduction=reduction) for reduction in (True, False))
    assert half.settings["details"]["reduction"] == "mirror" and "reduction" not in whole.settings["details"]
    assert max(half.residual, half.mass_defect, whole.residual) < 1e-13
    assert half.load == pytest.approx(whole.load, rel=1e-10)
