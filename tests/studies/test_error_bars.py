"""Error bars: first order beside samples, texts with units, the scene's table, bad input."""

import math

import pytest

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.ask import Ask
from lcp_lube.drivers.derivatives.gradient import gradients
from lcp_lube.studies.error_bars import deviations, first_order, monte_carlo


def test_samples_confirm_first_order():
    """Within four standard errors; both are of the same numbers, one of them at both ends of a balance."""
    scene = load_scene("pocketed_pad", n=42)
    with solve(scene) as solution:
        deviation = deviations(scene, {"fluid.mu": "3%", "film.pocket.depth": "10nm", "h": 1e-10})
        assert deviation == pytest.approx({"fluid.mu": 3e-4, "film.pocket.depth": 1e-8, "h_offset": 1e-10})
        (one,) = gradients(scene, solution, ["load"])
        size, parts = first_order(one, deviation)
        assert size == pytest.approx(math.hypot(*parts.values()))
        samples = monte_carlo(scene, solution, ["load", "friction"], deviation, 150, 3, Ask())
        again = (
            monte_carlo(scene, solution, ["load"], deviation, 5, 3, Ask()),
            monte_carlo(scene, solution, ["load"], deviation, 5, 3, Ask()),
        )
        assert again[0].mean == again[1].mean
    assert samples.solved == 150 and samples.deviation["load"] == pytest.approx(size, rel=4 * samples.error)
    assert samples.mean["load"] == pytest.approx(one.value, abs=4 * size / math.sqrt(150))


def test_the_command_and_the_scenes_table(cli, tmp_path):
    (tmp_path / "a.toml").write_text('family = "slider"\nn = 30\n[tolerance]\nmu = "5%"\n')
    done = cli("sensitivity", "a.toml", "--tolerance", "h_min=0.1um", "--monte-carlo", 4, "--json")
    bar = done.json["error_bar"]
    assert done.status == 0 and set(bar["parts"]) == {"mu", "h_min"} and bar["monte_carlo"]["samples"] == 4
    assert bar["parts"]["mu"] == pytest.approx(0.05 * done.json["value"], rel=1e-9)
    assert "to first order" in cli("sensitivity", "a.toml").out


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"h_mix": "1um"}, "nearest is h_min"),
        ({"mu": "1mm"}, "a viscosity"),
        ({"mu": "0%"}, "is the value"),
        ({"mu": "much"}, "a number"),
    ],
)
def test_bad_input(given, message):
    with pytest.raises(InputError, match=message):
        deviations(load_scene("problem1"), given)


def test_what_cannot_be_had(cli):
    done = cli("sensitivity", "problem1", "--monte-carlo", 5)
    assert done.status == 2 and "--tolerance KEY=U" in done.lines[0]
    done = cli("sensitivity", "two_groove_journal", "--n", 48, "--tolerance", "groove_deg=1")
    assert done.status == 2 and "no derivative" in done.lines[0] and len(done.lines) == 1
