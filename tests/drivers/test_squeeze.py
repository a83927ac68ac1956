"""The squeeze film against its exact solution (Optasanu and Bonneau; Ausas 2009), and its marching."""

import pytest

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.scene import load_scene

EXACT = {
    "rupture_time": 0.2500791572,
    "sigma": 0.9769922949,
    "sigma_time": 0.3148258627,
    "front": 0.0390872,
    "reformation_time": 0.7323899,
}


def march(**changes):
    solution = solve(load_scene("squeeze", changes))
    values = solution.problem.quantities(solution.fields)
    solution.destroy()
    assert solution.converged, solution.message
    return values


def errors(**changes):
    values = march(**changes)
    return {name: abs(values[name] - exact) for name, exact in EXACT.items()}


@pytest.fixture(scope="module")
def halving():
    """Errors on grids and time steps that halve."""
    return [errors(n=n, steps=steps) for n, steps in ((49, 75), (99, 150), (199, 300))]


def test_events_against_the_exact_solution(halving):
    fine = halving[-1]
    assert fine["rupture_time"] < 1e-6
    assert fine["sigma"] < 1e-4
    assert fine["sigma_time"] < 5e-5
    assert fine["front"] < 3e-5
    assert fine["reformation_time"] < 1e-4


def test_order(halving):
    """From halved grids and steps: second order or better, the front's noise apart."""
    for name in ("rupture_time", "sigma", "sigma_time", "reformation_time"):
        assert halving[2][name] < halving[0][name] / 10, name
    # In time alone. Rupture: p(1/2) reaches zero when the plates part fast enough, whatever the grid.
    coarse, fine = (errors(n=25, steps=steps)["rupture_time"] for steps in (60, 240))
    assert fine < coarse / 8
    assert errors(n=99, steps=450)["reformation_time"] < halving[1]["reformation_time"] / 3


def test_euler_is_of_first_order(halving):
    """Sigma's time: h'/h^3 is greatest half a step late."""
    coarse, fine = (errors(n=99, steps=steps, scheme="euler")["sigma_time"] for steps in (150, 600))
    assert 3 < coarse / fine < 5
    assert halving[1]["sigma_time"] < coarse / 5


def test_place_and_symmetry():
    values = march(n=60, steps=90)
    assert values["rupture"] == pytest.approx(0.5, abs=1e-12)
    assert values["half_width"] == pytest.approx(values["sigma"] - 0.5)
    assert values["cavitated_fraction"] == 0


def test_no_cavity_where_the_stroke_is_weak():
    """p(1/2) = p_wall - h'/(4 h^3) stays positive: no events, and the pressure of the middle is that formula's."""
    values = march(n=49, steps=400, h_amplitude=1e-4)
    assert values["rupture_time"] is None
    assert values["sigma"] is None
    assert values["reformation_time"] is None
    # h' = -1e-4 4 pi sin(4 pi t) is least, and p greatest, near t = 1/8.
    assert values["p_max"] == pytest.approx(0.025 + 1e-4 * 12.566370614359 / (4 * 0.375**3), rel=1e-4)
    assert values["p_max_time"] == pytest.approx(0.125, abs=0.005)


def test_walls_at_the_cavitation_pressure():
    """Nothing feeds the film when the plates part: all of it cavitates at once, with the liquid of the thinnest gap."""
    values = march(n=24, steps=48, t_end=0.6, p_wall=0.0)
    assert values["rupture_time"] == pytest.approx(0.25, abs=1e-3)
    assert values["reformation_time"] is None
    assert values["cavitated_fraction"] == 1


def test_cavity_at_the_end():
    values = march(n=49, steps=60, t_end=0.4, front_time=0.45)
    assert values["rupture_time"] is not None
    assert values["reformation_time"] is None
    assert values["front"] is None
    assert values["cavitated_fraction"] > 0.5


@pytest.mark.parametrize("method, system", [("din", "full"), ("din-pc", "reduced"), ("active-set", "full")])
def test_methods_agree(method, system):
    scene = load_scene("squeeze", {"n": 24, "steps": 36})
    found = []
    for name, matrix in ((method, system), ("auto", "auto")):
        solution = solve(scene, method=name, system=matrix)
        assert solution.converged, solution.message
        found.append(solution.problem.quantities(solution.fields))
        solution.destroy()
    for name in ("p_max", "reformation_time", "rupture_time"):
        assert found[0][name] == pytest.approx(found[1][name], rel=1e-3)


def test_a_step_that_fails_ends_the_march():
    solution = solve(load_scene("squeeze", {"n": 49, "steps": 75}), method="din", stopping={"max_it": 2})
    solution.destroy()
    assert solution.outcome is Outcome.MAX_ITERATIONS
    assert "time step 1, t = 0.01:" in solution.message
    assert solution.settings["details"]["time_steps"] == 0


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"h_amplitude": 0.375}, "less than h_mean"),
        ({"steps": 1}, "steps = 1"),
        ({"scheme": "rk4"}, "scheme = rk4"),
        ({"p_wall": -1.0}, "p_wall"),
        ({"speed": 1.0}, "unknown key speed"),
    ],
)
def test_bad_input(changes, words):
    with pytest.raises(InputError, match=words):
        load_scene("squeeze", changes)


def test_options_that_do_not_fit():
    scene = load_scene("squeeze", {"n": 24, "steps": 30})
    with pytest.raises(InputError, match="allowed are full, reduced"):
        solve(scene, system="cavity")
    with pytest.raises(InputError, match="goes on in time"):
        solve(scene, nested=True)


def test_data_beyond_all_measure():
    with pytest.raises(InputError, match="coefficients"):
        solve(load_scene("squeeze", {"t_end": 1e300}))


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks(cli, ranks):
    """The same on any number of ranks; iterations are those of all steps."""
    run = cli("solve", "squeeze", "--n", 31, "--set", "steps=16", "--set", "t_end=0.5", "--json", ranks=ranks)
    assert run.status == 0, run.err
    alone = march(n=31, steps=16, t_end=0.5)
    for name in ("rupture_time", "sigma", "sigma_time", "front", "p_max"):
        assert run.json[name] == pytest.approx(alone[name], rel=1e-9)
    assert run.json["iterations"] >= 16
    assert run.json["mass_defect"] < 1e-8


def test_summary_plot_and_accuracy(cli, tmp_path):
    run = cli("solve", "squeeze", "--n", 24, "--set", "steps=36", "--plot", "squeeze.png", "--output", "squeeze.npz")
    assert run.status == 0, run.err
    assert "rupture_time 0.25" in run.out
    assert (tmp_path / "squeeze.png").stat().st_size > 1000
    run = cli("solve", "squeeze", "--accuracy", "1e-2", "--json")
    assert run.status == 0, run.err
    assert abs(run.json["sigma"] / EXACT["sigma"] - 1) <= run.json["accuracy_estimate"] <= 1e-2
