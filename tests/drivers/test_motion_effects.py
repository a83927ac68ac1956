"""Effects in time: a fluid that gives way, against its exact oscillation; walls, shear and roughness, with mass conserved."""

from typing import Any

import marches
import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers import film_part
from lcp_lube.drivers.effects.loop import Loop
from lcp_lube.drivers.marches import supply_step
from lcp_lube.problems.film.fluid import Law
from lcp_lube.solvers.fas.driver import Fas

WEDGE = marches.WEDGE | {"n": 24, "motion": {"t_end": 0.02, "steps": 12}}
EFFECTS: dict[str, dict[str, Any]] = {
    "density": {"fluid": {"mu": 0.01, "p_supply": 1e5, "density": "dowson-higginson"}},
    "shear": {"shear": {"law": "eyring", "tau_0": 5e5}},
    "roughness": {"roughness": {"sigma_um": 0.3, "moving": 0.8}},
    "elastic": {"elastic": {"compliance": 1e-14}},
}
EFFECTS["all"] = {
    **{key: value for effect in EFFECTS.values() for key, value in effect.items()},
    "fluid": {"mu": 0.01, "p_supply": 1e5, "barus": 1e-9, "density": "dowson-higginson"},
}


def test_a_fluid_that_gives_way_between_plates():
    """Plates h0 (1 + eps sin wt) with rho'/rho = s: p - p_s = -Re[eps/s (1 - cosh k(x - L/2)/cosh kL/2) exp(iwt)/i],
    k^2 = 12 i mu w s/h0^2, second order in the step."""
    mu, L, h0, ps, eps, n = 0.1, 0.1, 1e-5, 1e6, 1e-4, 19
    law = Law(0.0, True)
    s = float(law.density_slope(np.array(ps)) / law.density(np.array(ps)))
    w = 4.0 * h0**2 / (12.0 * mu * s * L**2)
    t_end, x = 1.25 * 2 * np.pi / w, np.arange(1, n + 1) / (n + 1) * L
    k = np.sqrt(12j * mu * w * s) / h0
    P = -eps / s * (1 - np.cosh(k * (x - L / 2)) / np.cosh(k * L / 2)) / 1j
    errors = []
    for steps in (25, 50):
        scene = {
            "family": "bearing", "L": L, "U": 0.0, "n": n,
            "fluid": {"mu": mu, "p_supply": ps, "density": "dowson-higginson"},
            "film": {"shape": "formula", "h": f"{h0}*(1+{eps}*sin({w}*t))"}, "motion": {"t_end": t_end, "steps": steps},
        }  # fmt: skip
        solution = solve(load_scene(scene))
        assert solution.converged and solution.mass_defect_run < 1e-10
        found = solution.fields["p"] * solution.problem.p_unit - ps
        errors.append(np.abs(found - (P * np.exp(1j * w * t_end)).real).max() / np.abs(P).max())
        solution.destroy()
    assert errors[1] < 1e-2 and errors[0] / errors[1] > 3.5


@pytest.mark.parametrize("name", EFFECTS)
def test_nothing_is_lost(name):
    """In every step and in the whole run, walls moving either way; and a film at rest ends the same however it began."""
    ends = []
    for U in (1.0, -1.0):
        solution = solve(load_scene(WEDGE | EFFECTS[name] | {"U": U}))
        assert solution.converged, solution.message
        assert solution.mass_defect < 1e-10 and solution.mass_defect_run < 1e-10
        assert max(row["cavitated_fraction"] for row in solution.history) > 0.05
        ends.append(solution.load)
        solution.destroy()
    assert ends[0] == pytest.approx(ends[1], rel=1e-8)  # waves are symmetric
    still = WEDGE | EFFECTS[name] | {"film": WEDGE["film"][:1], "scheme": "face"}
    loads = []
    for motion in ({"t_end": 0.5, "steps": 25, "start": "full"}, {"t_end": 0.5, "steps": 5}):
        solution = solve(load_scene(still | {"motion": motion}))
        assert solution.converged, solution.message
        loads.append(solution.load)
        solution.destroy()
    assert loads[0] == pytest.approx(loads[1], rel=1e-4)


def test_the_decision_in_time():
    """What a march in few steps finds small over the whole time is left out, and is: of a long march. A short one has all."""
    film = {"shape": "formula", "h": "1.4e-5*(1+0.4*sin(62.8*x))*(1+0.1*sin(600*t))"}
    data = {"family": "bearing", "L": 0.1, "U": 0.5, "n": 40, "film": film, "fluid": {"mu": 0.01}}
    data |= {"shear": {"law": "eyring", "tau_0": 1e6}, "motion": {"t_end": 0.02, "steps": 120}}
    runs = {}
    for model in ("auto", "full"):
        with solve(data, model=model) as s:
            assert s.converged, s.message
            runs[model] = np.array([row["load"] for row in s.history]), s.settings["model"]
    (load, told), (full, _) = runs["auto"], runs["full"]
    off = np.max(np.abs(load - full)) / np.max(full)
    assert 0.1 * off < abs(told["left_out"]["shear"]) < 10.0 * off < told["tolerance"]  # few steps miss the load's peaks
    with solve(data | {"motion": {"t_end": 0.002, "steps": 8}}) as s:
        assert not s.settings["model"]["left_out"] and "so few steps" in s.settings["model"]["reason"]


@pytest.mark.parametrize("film", ["plates", "ring"])
def test_density_costs_no_more_steps_than_none(film):
    """One or two Newton steps a time step, also where compression is most of what a cell gains; the loop's answer."""
    fluid = {"mu": 0.05, "p_supply": 1e6, "density": "dowson-higginson"}
    data: dict[str, Any] = {"family": "bearing", "L": 0.1, "fluid": fluid}
    if film == "plates":
        data |= {"U": 0.0, "n": 49, "film": {"shape": "linear", "h_start": 6e-5, "h_end": 3e-5}}
        data["motion"] = {"t_end": 0.02, "steps": 40, "set": {"h_offset": "3e-6*sin(314*t)"}}
    else:
        data |= {"U": 5.0, "n": 60, "film": {"shape": "journal", "c": 2e-5, "eccentricity": 0.5}}
        data["motion"] = {"t_end": 0.02, "steps": 40, "journal": ["0.5+0.1*sin(314*t)", "0.1*sin(314*t)"]}
    solution, by_loop = solve(load_scene(data)), solve(load_scene(data), method="din", stopping={"eps1": 1e-8})
    assert solution.converged and solution.mass_defect < 1e-10 and solution.mass_defect_run < 1e-10
    assert any("as a whole" in reason for reason in solution.settings["why"])
    counts = [row["iterations"] for row in solution.history[4:]]
    # Not a step more than a film of constant density takes, but for its front.
    assert sum(counts) < 1.6 * len(counts)
    loads = [np.array([row["load"] for row in one.history]) for one in (solution, by_loop)]
    assert np.abs(loads[0] - loads[1]).max() < 1e-4 * np.abs(loads[1]).max()
    solution.destroy()
    by_loop.destroy()


def test_a_journal_is_free_in_a_fluid_that_gives_way():
    """Newton's method on its place has the film's exact stiffness, that of compression too."""
    film = {"shape": "journal", "c": 2e-5, "eccentricity": 0.5}
    motion: dict[str, Any] = {"t_end": 0.002, "steps": 6, "start": "full", "free": True, "mass": 5.0, "position": [0.3, 0.2]}
    motion["load"] = ["3e3", "2e2"]
    data = {"family": "bearing", "dimension": 2, "L": 0.1, "width": 0.04, "nx": 24, "ny": 5, "U": 5.0, "film": film}
    data |= {"sides": {"west": "periodic", "east": "periodic"}, "motion": motion}
    solution = solve(load_scene(data | {"fluid": {"mu": 0.05, "p_supply": 1e5, "density": "dowson-higginson"}}))
    assert solution.converged, solution.message
    assert solution.mass_defect_run < 1e-10 and max(row["solves"] for row in solution.history) < 15
    solution.destroy()


@pytest.mark.parametrize(("method", "dt"), [("active-set", 1e-5), ("active-set", 1e-11), ("fas", 1e-11)])
def test_steps_of_any_length_settle(method, dt, monkeypatch):
    """Between soft walls, in a fluid that gives way and gets warm: in two or three films a step, not more in shorter ones."""
    film, films = Loop.film, [0]

    def counted(*given):
        films[0] += 1
        return film(*given)

    monkeypatch.setattr(Loop, "film", counted)
    wedge = {"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}
    data: dict[str, Any] = {"family": "bearing", "L": 0.06, "U": 4.0, "n": 60, "film": wedge, "elastic": {"compliance": 1e-13}}
    data |= {"fluid": {"p_supply": 1e5, "density": "dowson-higginson", "barus": 1.5e-8}}
    data |= {"temperature": {"oil": "ISO VG 68", "T_in": "50 degC"}}
    data["motion"] = {"t_end": 8 * dt, "steps": 8, "set": {"h_offset": "2e-6*sin(628*t)"}}
    if method == "fas":
        del data["n"]
        data |= {"dimension": 2, "width": 0.04, "nx": 24, "ny": 12}
    loads = []
    for name in dict.fromkeys((method, "active-set")):
        films[0] = 0
        with solve(data, method=name) as solution:
            assert solution.converged, solution.message
            assert solution.mass_defect < 1e-10 and solution.mass_defect_run < 1e-10
            loads.append([row["load"] for row in solution.history])
        assert films[0] <= 3 * 8 + 8  # the steady film's with them
    assert loads[0] == pytest.approx(loads[-1], rel=1e-6)


def test_large_symmetric_films_begin_by_the_method_that_half_of_them_takes():
    """The steps' own options are multigrid's, of the whole film; the steady film at t = 0 is solved on half of its points."""
    data: dict[str, Any] = {"family": "bearing", "dimension": 2, "L": 0.06, "width": 0.04, "U": 5.0, "nx": 128, "ny": 96}
    data |= {"film": {"shape": "formula", "h": "3e-5*(1+0.5*cos(209*x))*(1+0.1*sin(314*t))"}}
    for fluid in ({}, {"density": "dowson-higginson"}):
        motion = {"t_end": 2e-4, "steps": 2}
        with solve(data | {"fluid": {"mu": 0.03, "p_supply": 1e5, **fluid}, "motion": motion}) as solution:
            assert solution.converged and solution.method == "fas" and solution.mass_defect_run < 1e-10, solution.message


def test_cavitated_films_with_density_take_one_film_a_step(monkeypatch):
    """Multigrid's film takes the densities of its pressures between cycles: no second one, whatever a front passes."""
    film, films = Loop.film, list[Any]()
    monkeypatch.setattr(Loop, "film", lambda loop, cells: films.append(loop.model.stored) or film(loop, cells))
    shape = {"shape": "formula", "h": "1e-5*(1.5+0.4*sin(600*t)+0.6*cos(418*x-300*t))"}
    data: dict[str, Any] = {"family": "bearing", "dimension": 2, "L": 0.03, "width": 0.02, "U": 5.0, "nx": 64, "ny": 40}
    data |= {"film": shape, "fluid": {"mu": 0.03, "p_supply": 1e5, "density": "dowson-higginson"}}
    loads = []
    for method in ("fas", "active-set"):
        with solve(data | {"motion": {"t_end": 1e-3, "steps": 10}}, method=method) as solution:
            assert solution.converged and solution.mass_defect_run < 1e-10, solution.message
            assert method != "fas" or sum(stored is not None for stored in films) == 10
            loads.append([row["load"] for row in solution.history])
    assert loads[0] == pytest.approx(loads[1], rel=1e-3)  # the formula's error is far more


@pytest.mark.parametrize("effect", ["none", "density", "walls"])
def test_pressures_of_supplies_follow(effect, monkeypatch):
    """Unknowns of each step beside the film's: one or two steps of Newton's method, two or three films between soft walls."""
    sources = [
        {"restrictor": "capillary", "K": 2e-10, "p_s": 3e6},
        {"restrictor": "orifice", "K": 2e-7, "p_s": 3e6},
        {"flow": 1e-4},
    ]
    supply = [{"x_mm": [9 + 12 * k, 13 + 12 * k], **source} for k, source in enumerate(sources)]
    film = {"shape": "formula", "h": "4e-5*(1+8*x)*(1+0.3*sin(314*t))"}
    data: dict[str, Any] = {"family": "bearing", "L": 0.05, "U": 2.0, "n": 45, "supply": supply, "film": film}
    fluid = {"density": {"density": "dowson-higginson"}, "walls": {"barus": 2e-8}}.get(effect, {})
    data |= {"fluid": {"mu": 0.03, "p_supply": 1e5, **fluid}, "motion": {"t_end": 0.003, "steps": 9}}
    data |= {"elastic": {"compliance": 1e-13}} if effect == "walls" else {}
    loads, counts = [], []
    for way in (supply_step.solve, lambda *_: None):  # and around films with given pressures
        monkeypatch.setattr(supply_step, "solve", way)
        with solve(data, model="full") as solution:
            assert solution.converged and solution.mass_defect < 1e-10 and solution.mass_defect_run < 1e-10
            loads.append([row["load"] for row in solution.history])
            counts.append(np.mean([row["iterations"] for row in solution.history[3:]]))
    assert loads[0] == pytest.approx(loads[1], rel=1e-3 if effect == "density" else 1e-5)  # the formula's error is 1e-2
    assert counts[0] <= (3.0 if effect == "walls" else 1.5)


@pytest.mark.parametrize("ny", [10, 11])
def test_half_of_a_symmetric_film_and_its_supplies_is_solved(ny, monkeypatch):
    """Also with lines of points in its middle, which half of it has half of; each source feeds both halves."""
    sources: list[dict[str, Any]] = [{"restrictor": "capillary", "K": 4e-12, "p_s": 3e6}, {"flow": 2e-6}]
    supply = [{"x_mm": [9 + 12 * k, 15 + 12 * k], "y_mm": [6, 14], **one} for k, one in enumerate(sources)]
    film = {"shape": "formula", "h": "4e-5*(1+8*x)*(1+0.3*sin(314*t))"}
    data = {"family": "bearing", "dimension": 2, "L": 0.05, "width": 0.02, "U": 2.0, "nx": 24, "ny": ny, "film": film}
    data |= {"fluid": {"mu": 0.03, "p_supply": 1e5, "barus": 2e-8}, "elastic": {"compliance": 1e-13}, "supply": supply}
    found, looks, part_of = [], list[int](), film_part.part_of

    def counted(*given):
        looks[-1] += 1
        return part_of(*given)

    monkeypatch.setattr(film_part, "part_of", counted)
    for least in (0, 10**9):
        looks.append(0)
        monkeypatch.setattr(supply_step, "HALVED", least)
        with solve(data | {"motion": {"t_end": 0.002, "steps": 4}}, model="full") as solution:
            assert solution.converged and solution.mass_defect_run < 1e-10
            found.append([row["load"] for row in solution.history])
    assert looks[0] >= looks[1] + 4 and found[0] == pytest.approx(found[1], rel=1e-10)


@pytest.mark.parametrize("effect", ["none", "density", "walls"])
def test_pressures_of_supplies_follow_in_cycles_of_multigrid(effect, monkeypatch):
    """One more unknown each on every grid: the answer of Newton's method, in one cycle or two, V where that will do."""
    own, kinds = Fas._kind, [""]
    monkeypatch.setattr(Fas, "_kind", lambda self: (kinds.append(own(self)), kinds[-1])[1])
    sources = [
        {"restrictor": "capillary", "K": 4e-12, "p_s": 3e6},
        {"restrictor": "orifice", "K": 4e-9, "p_s": 3e6},
        {"flow": 2e-6},
    ]
    sides = [[6, 14], [3, 11], [6, 14]] if effect == "none" else [[6, 14]] * 3  # else half of the film is solved
    places = [{"x_mm": [9 + 12 * k, 15 + 12 * k], "y_mm": y} for k, y in enumerate(sides)]
    film = {"shape": "formula", "h": "4e-5*(1+20*x)*(1+0.3*sin(314*t))"}
    data: dict[str, Any] = {"family": "bearing", "dimension": 2, "L": 0.05, "width": 0.02, "U": 2.0, "nx": 64, "ny": 40}
    fluid = {"density": {"density": "dowson-higginson"}, "walls": {"barus": 2e-8}}.get(effect, {})
    # Of so long a step that one cycle is just enough, or just not, the count would say nothing.
    data |= {"film": film, "fluid": {"mu": 0.03, "p_supply": 1e5, **fluid}, "motion": {"t_end": 0.0012, "steps": 10}}
    data |= {"supply": [{**x, **q} for x, q in zip(places, sources, strict=True)]}
    data |= {"elastic": {"compliance": 1e-13}} if effect == "walls" else {}
    found = []
    for method in ("active-set", "fas"):
        with solve(data, method=method) as solution:
            assert solution.converged and solution.mass_defect < 1e-10 and solution.mass_defect_run < 1e-10
            found.append([row["load"] for row in solution.history])
            iterations = np.mean([row["iterations"] for row in solution.history[3:]])
    assert found[1] == pytest.approx(found[0], rel=1e-4)  # the formula's error is some 1e-2
    assert iterations <= (2.0 if effect == "walls" else 1.6)


def test_pressures_of_supplies_in_a_cavity_do_not_swing():
    """A film that is cavitated beside a supply takes the less of its pressure the coarser the grid: that took 20 cycles."""
    data: dict[str, Any] = {"family": "bearing", "dimension": 2, "L": 0.05, "width": 0.043, "U": 5.0, "nx": 160, "ny": 72}
    film = {"shape": "formula", "h": "2.8e-5*(1+0.53*cos(125.66370614*x-2.434)*(1+0.16*sin(409*t)))"}
    data |= {"film": film, "fluid": {"mu": 0.045, "p_supply": 1e5}, "sides": {"west": "periodic", "east": "periodic"}}
    data |= {"supply": [{"flow": 9e-8, "x_mm": [14.1, 28.7], "y_mm": [17.5, 25.4]}], "motion": {"t_end": 1.5e-4, "steps": 2}}
    with solve(data, method="fas", options={"rest": 0.0}) as solution:
        assert solution.converged and solution.mass_defect_run < 1e-12
        assert max(row["iterations"] for row in solution.history) <= 13
