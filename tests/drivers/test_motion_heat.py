"""Temperature in time: heat that the oil stores, conserved in every step; rest is the steady film; the formulas' orders."""

from typing import Any

import marches
import numpy as np
import pytest

from lcp_lube import load_scene, solve

OIL: dict[str, Any] = {"fluid": {"mu": 0.02, "p_supply": 4e6}, "temperature": {"beta": 0.03, "T_in": 313.0}}
STILL = {"family": "bearing", "L": 0.1, "U": 20.0, "n": 40, "film": {"shape": "formula", "h": "7.5e-5*(1+0.4*cos(62.83*x))"}}
MODELS = ("energy", "effective")


def balanced(solution: Any) -> None:
    """Every step's certificate and balance: what drag, pumps and walls put in flows out or is stored."""
    assert solution.converged, solution.message
    assert solution.heat_defect < 1e-8 and solution.energy_residual < 1e-8 and solution.mass_defect < 1e-10
    most = max(abs(row["heat_power"]) for row in solution.history)
    for row in solution.history:
        assert row["heat_power"] - row["heat_out"] - row["heat_stored"] == pytest.approx(0.0, abs=1e-8 * most)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("scheme", ["euler", "bdf2"])
def test_rest_is_the_steady_film(model, scheme):
    """However the march began; a cold film warms up on the way, and stores heat."""
    plane = {
        "dimension": 2,
        "width": 0.08,
        "nx": 24,
        "ny": 7,
    }  # lines at rest have exact integrals, which those in time have not
    data = (
        {key: STILL[key] for key in STILL if key != "n"} | plane | OIL | {"temperature": OIL["temperature"] | {"model": model}}
    )
    with solve(load_scene(data), model="full") as steady:
        for start in ("steady", "full"):
            motion = {"t_end": 0.15, "steps": 25, "scheme": scheme, "start": start}
            with solve(load_scene(data | {"motion": motion}), model="full") as s:
                balanced(s)
                assert s.load == pytest.approx(steady.load, rel=1e-6)
                assert s.temperature_max - 313.0 == pytest.approx(steady.temperature_max - 313.0, rel=1e-6)
                assert s.heat_out == pytest.approx(steady.heat_out, rel=1e-6)
                first = s.history[0]
                assert first["heat_stored"] > 0.3 * first["heat_power"] if start == "full" else abs(first["heat_stored"]) < 1.0


def test_a_film_that_only_stores():
    """Closed at both ends, parallel, sheared: T rises by mu U^2/(rho c h^2) t, viscosity constant; its oil moves round."""
    h, U, mu, rho_c, t = 5e-5, 4.0, 0.02, 860.0 * 1950.0, 0.02
    data = {
        "family": "bearing", "L": 0.1, "U": U, "n": 20, "fluid": {"mu": mu}, "film": {"shape": "formula", "h": f"{h}"},
        "sides": {"west": {"kind": "periodic"}, "east": {"kind": "periodic"}},
        "temperature": {"beta": 0.0, "T_in": 313.0, "rho": 860.0, "specific_heat": 1950.0},
        "motion": {"t_end": t, "steps": 10, "fill": 1.0, "scheme": "euler"},
    }  # fmt: skip
    with solve(load_scene(data | {"motion": data["motion"] | {"fill": 0.999}}), model="full") as s:
        balanced(s)
        assert s.temperature_max - 313.0 == pytest.approx(mu * U**2 / (rho_c * h**2) * t, rel=2e-3)  # void drags less
        assert s.heat_out == 0.0


@pytest.mark.parametrize("model", MODELS)
def test_second_order_in_time(model):
    """BDF2, against three times as many steps as the finest; a full film whose walls move."""
    film = {"shape": "formula", "h": "7.5e-5*(1+3*x)*(1+0.2*sin(600*t)**2)"}
    data = STILL | OIL | {"U": 2.0, "n": 16, "film": film, "temperature": OIL["temperature"] | {"model": model}}
    found = []
    for steps in (10, 20, 60):
        motion = {"t_end": 0.01, "steps": steps}
        with solve(load_scene(data | {"motion": motion}), model="full", stopping={"eps1": 1e-10}) as s:
            balanced(s)
            assert s.cavitated_fraction == 0
            found.append(np.concatenate([[s.load / 1e3], s.field("T") - 313.0]))
    errors = [np.linalg.norm(one - found[-1]) for one in found[:-1]]
    assert errors[0] / errors[1] > 3.3


@pytest.mark.parametrize(
    "changes", [{}, {"U": -1.0}, {"shear": {"law": "eyring", "tau_0": 1e5}, "temperature.exchange": 300.0}]
)
def test_with_a_cavity_and_walls_moving_either_way(changes):
    """Waves and cavities that travel; steps by their error's estimate."""
    with solve(
        load_scene(marches.WEDGE | {"n": 24} | OIL | {"motion": {"t_end": 0.02, "tol": 1e-2}}, changes), model="full"
    ) as s:
        balanced(s)
        assert max(row["cavitated_fraction"] for row in s.history) > 0.05
        assert s.mass_defect_run < 1e-10 and s.temperature_max > 313.5


def test_journals_given_and_free_and_taken_up(tmp_path):
    """Between grooves and of a free journal; a run taken up ends the same."""
    oil = {"temperature": {"T_in": 313.0, "oil": "ISO VG 32"}, "nx": 48, "ny": 7, "balance": None}
    moved = {"t_end": 0.02, "steps": 8, "journal": ["0.4+0.2*cos(314*t)", "0.2*sin(314*t)"]}
    with solve(load_scene("two_groove_journal", oil | {"motion": moved}), model="full") as s:
        balanced(s)
        assert s.temperature_max > 320.0
    free = {"nx": 36, "ny": 3, "motion.dt": 4e-4, "motion.steps": None, "temperature": OIL["temperature"]}
    half, scene = (load_scene("dynamic_journal", free | {"motion.t_end": t}) for t in (1.2e-3, 2.4e-3))
    file = tmp_path / "run.lcp"
    with solve(half, model="full", checkpoint=file, every=3) as first:
        balanced(first)
    with solve(scene, model="full") as whole, solve(scene, model="full", resume=file) as rest:
        balanced(rest)
        for name in ("load", "temperature_max", "heat_stored"):
            assert getattr(rest, name) == pytest.approx(getattr(whole, name), rel=1e-6)
