"""Friction, flows, power and places: against exact solutions, by conservation, and under the laws that tie them together."""

from itertools import pairwise

import numpy as np
import pytest
from films import MU, WIDTH, FilmScene, Knots, L, U, knots, make_problem, pressures, schemes, shapes
from hypothesis import given, settings

from lcp_lube import load_scene, solve
from lcp_lube.base.stages import Stages
from lcp_lube.problems.film.flows import SIDES
from lcp_lube.problems.film.model import Model, Side
from lcp_lube.solvers.active_set import ActiveSet
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping, iterate

OCTAVES, PER_OCTAVE = (50, 100, 200, 400), 8


def exact_drag(scene):
    """Drag and dissipation (N/m, W/m) of the exact 1D solution by quadrature: mu U (1 - r)/h + (h/2) p', and
    mu U^2 (1 - r)/h + h^3 p'^2/(12 mu); p' = 6 mu (U h - Q)/h^3 where the film is full."""
    exact, film = scene.exact(), scene.gap
    edges = np.unique([x for x in (0.0, exact.rupture, exact.reformation, scene.L, *film.breakpoints()) if x is not None])
    nodes, weights = np.polynomial.legendre.leggauss(80)
    drag = loss = 0.0
    for a, b in pairwise(edges):
        x = 0.5 * (a + b) + 0.5 * (b - a) * nodes
        h, r = film(x), exact.r(x)
        slope = np.where(r > 0, 0.0, 6 * scene.mu * (scene.U * h - exact.Q) / h**3)
        w = 0.5 * (b - a) * weights
        drag += w @ (scene.mu * scene.U * (1 - r) / h + 0.5 * h * slope)
        loss += w @ (scene.mu * scene.U**2 * (1 - r) / h + h**3 * slope**2 / (12 * scene.mu))
    return drag, loss


def found(scene):
    solution = solve(scene, method="active-set", nested=False)
    assert solution.converged, solution.message
    values = solution.problem.quantities(solution.fields)
    solution.destroy()
    return values


@pytest.mark.parametrize("name", ["problem1", "problem2", "problem3"])
def test_friction_is_of_second_order_on_average(name):
    """The void is known at the faces, not at the points: there the drag of a cavity would be of first order."""
    drag, _ = exact_drag(load_scene(name))
    means = []
    for n in OCTAVES:
        sizes = np.round(n * 2 ** (np.arange(PER_OCTAVE) / PER_OCTAVE)).astype(int)
        means.append(np.mean([abs(found(load_scene(name, {"n": int(n)}))["friction"] / drag - 1) for n in sizes]))
    assert -np.polyfit(np.log(OCTAVES), np.log(means), 1)[0] > 1.7, means
    assert means[-1] < 1.5e-5


@pytest.mark.parametrize("name", ["problem1", "problem2", "problem3"])
def test_what_goes_in_as_power_is_dissipated(name):
    """friction U + p_a Q - p_b Q = the dissipation of the exact fields, where the whole flow passes both ends."""
    scene = load_scene(name, {"n": 800})
    drag, loss = exact_drag(scene)
    values, Q = found(scene), scene.exact().Q
    assert drag * scene.U + 0.5 * Q * (scene.p_a - scene.p_b) == pytest.approx(loss, rel=1e-9)  # the formulae themselves
    assert values["power_loss"] == values["friction"] * scene.U
    assert values["power_loss"] - sum(p * values["flow"][side] for p, side in ((scene.p_a, "west"), (scene.p_b, "east"))) == (
        pytest.approx(loss, rel=1e-4)
    )
    assert values["flow"]["east"] == pytest.approx(0.5 * Q, rel=1e-4)


@settings(max_examples=40)
@given(shape=shapes, film=knots(), scheme=schemes, p_sides=pressures)
def test_flows_sum_to_zero(shape, film, scheme, p_sides):
    """Whatever the film, the scheme and the sides: conservation is in the scheme."""
    nx, ny = (*shape, 1)[:2]
    data = {"nx": nx} if len(shape) == 1 else {"dimension": 2, "nx": nx, "ny": ny, "width": WIDTH, "p_side": p_sides[2]}
    scene = FilmScene.of(film, **data, L=L, mu=MU, U=U, scheme=scheme, p_a=p_sides[0], p_b=p_sides[1])
    values = found(scene)
    flow = values["flow"]
    assert tuple(flow) == SIDES[: 2 * len(shape)]
    assert abs(sum(flow.values())) <= 1e-9 * sum(map(abs, flow.values()))
    if len(shape) == 2:
        assert values["side_leakage"] == flow["south"] + flow["north"]


def test_flows_of_a_plain_film():
    """Couette flow U h width/2 and Poiseuille flow h^3 width dp/(12 mu L), through the whole width, strips included."""
    h, p_a = 2e-5, 3e6
    problem = make_problem((9,), Knots((h,)), p_sides=(p_a, 0, 0, 0))
    p = p_a / 1e6 * (1 - problem.grid.x[0] / L)
    flow = problem.quantities({"p": p, "r": np.zeros(9)})["flow"]
    assert flow["east"] == pytest.approx(U * h / 2 + h**3 * p_a / (12 * MU * L), rel=1e-13)
    problem.destroy()
    problem = make_problem((4, 6), Knots((h,)))
    flow = problem.quantities({"p": np.zeros(24), "r": np.zeros(24)})["flow"]
    assert flow["east"] == pytest.approx(U * h / 2 * WIDTH, rel=1e-13) == -flow["west"]
    assert flow["south"] == flow["north"] == 0.0
    problem.destroy()


def test_side_leakage_and_friction_of_a_journal_converge():
    """Steps of refinement shrink faster than twofold (the front's place in its cell disturbs them); both ends leak the same."""
    values = [found(load_scene("journal", {"nx": 32 * k - 1, "ny": 8 * k - 1})) for k in (1, 2, 4, 8)]
    for key, least in (("side_leakage", 2.2), ("friction", 2.5), ("load", 2.5)):
        steps = np.abs(np.diff([v[key] for v in values]))
        assert steps[0] / steps[2] > least**2, (key, steps)
    last = values[-1]
    assert last["flow"]["south"] == pytest.approx(last["flow"]["north"], rel=1e-6)
    assert np.hypot(*last["force"]) == pytest.approx(last["load"], rel=1e-13)
    assert last["friction_coefficient"] == last["friction"] / last["load"]


def test_load_and_friction_coefficient():
    """Raising every pressure by the same amount changes neither; a load that points the other way has no coefficient."""
    low, high = (found(load_scene("problem1", {"n": 60, "p_c": p_c})) for p_c in (0.0, 3e5))
    for key in ("load", "friction_coefficient", "power_loss"):
        assert high[key] == pytest.approx(low[key], rel=1e-12)
    assert (low["p_ambient"], high["p_ambient"]) == (0.0, 3e5)
    textured = found(load_scene("textured_slider", {"K": 1}))
    assert textured["load"] < 0 and textured["friction_coefficient"] is None


@pytest.mark.parametrize("nx, ny", [(4, 6), (5, 1), (1, 3)])
def test_places(nx, ny):
    """The largest pressure is where it was put; a side's is in its middle; the thinnest film may be on the boundary."""
    problem = make_problem((nx, ny), Knots((2e-5, 1e-5), tilt=0.5))
    p = np.ones((ny, nx))
    p[ny // 2, nx // 2] = 2.0
    values = problem.quantities({"p": p.ravel(), "r": np.zeros(p.size)})
    assert values["p_max_at"] == pytest.approx([L * (nx // 2 + 1) / (nx + 1), WIDTH * (ny // 2 + 1) / (ny + 1)])
    assert (values["min_h"], values["min_h_at"]) == (1e-5, [L, 0.0])
    problem.destroy()
    problem = make_problem((nx, ny), Knots((2e-5,)), p_sides=(0, 0, 0, 3e6))
    values = problem.quantities({"p": p.ravel(), "r": np.zeros(p.size)})
    assert (values["p_max"], values["p_max_at"]) == (3e6, [L / 2, WIDTH])
    problem.destroy()


def test_no_place_in_a_field_that_overflowed():
    problem = make_problem((4,), Knots((1e-5, 2e-5)))
    values = problem.quantities({"p": np.array([1.0, np.nan, 1.0, 1.0]), "r": np.zeros(4)})
    assert np.isnan(values["p_max"]) and values["p_max_at"] is None
    problem.destroy()


def test_fronts_on_the_middle_line_of_a_wide_bearing_are_those_of_the_long_one():
    wide = found(load_scene("journal", {"nx": 199, "ny": 19, "width_over_diameter": 30.0}))
    long = found(load_scene("long_journal", {"n": 199}))
    assert wide["rupture"] == pytest.approx(long["rupture"], abs=1.5 * np.pi * 0.1 / 200)
    assert wide["cavitated_area"] == pytest.approx(wide["cavitated_fraction"] * np.pi * 0.1 * 3.0, rel=0.06)


PER_WIDTH = ("load", "friction", "pressure_integral", "power_loss", "cavitated_area")


def on_sides(shape, film, sides, width=WIDTH):
    """Quantities of a film with sides of any kind; all of them per whole width where half of it is modelled."""
    model = Model((L, width)[: len(shape)], sides, film, MU, U, 0.0, 1e6, "face", integrals=False)
    problem = model.build(shape)
    run = ActiveSet(Job(problem, Stages(), "reduced"))
    outcome, message, _ = iterate(run, Stopping())
    assert outcome == "converged", message
    values = problem.quantities(run.fields)
    run.destroy()
    problem.destroy()
    return values


def test_closed_mirror_and_periodic_sides():
    """A film that does not depend on y: between closed or periodic sides it is the 1D film; half of it, up to a mirror or a
    closed side, is half of the whole."""
    film, west, east = Knots((2e-5, 1e-5, 2e-5)), Side(p=1e6), Side(p=5e5)
    line = on_sides((31,), film, (west, east, Side(), Side()))
    for kinds in (("closed", "closed"), ("periodic", "periodic"), ("closed", "mirror")):
        wide = on_sides((31, 6), film, (west, east, *map(Side, kinds)))
        for key in PER_WIDTH:
            assert wide[key] == pytest.approx(line[key] * WIDTH, rel=1e-7), (kinds, key)
        assert wide["flow"]["east"] == pytest.approx(line["flow"]["east"] * WIDTH, rel=1e-7)
        for key in ("p_max", "rupture", "reformation", "cavitated_fraction", "friction_coefficient", "min_h"):
            assert wide[key] == pytest.approx(line[key], rel=1e-7), (kinds, key)
    whole = on_sides((31, 7), film, (west, east, Side(p=2e5), Side(p=2e5)))
    half = on_sides((31, 4), film, (west, east, Side(p=2e5), Side("mirror")), WIDTH / 2)
    for key in PER_WIDTH:
        assert 2 * half[key] == pytest.approx(whole[key], rel=1e-7), key
    assert 2 * half["side_leakage"] == pytest.approx(whole["side_leakage"], rel=1e-7)
    for key in ("p_max", "p_ambient", "rupture", "reformation", "min_h"):
        assert half[key] == pytest.approx(whole[key], rel=1e-7), key
    even = on_sides((31, 8), film, (west, east, Side(p=2e5), Side(p=2e5)))
    closed = on_sides((31, 4), film, (west, east, Side(p=2e5), Side("closed")), WIDTH / 2)
    for key in PER_WIDTH:
        assert 2 * closed[key] == pytest.approx(even[key], rel=1e-7), key


def test_periodic_along_the_flow():
    """A film of constant thickness goes round: Couette shear, no flow through the periodic sides, ambient from the others."""
    h = 2e-5
    values = on_sides((12, 5), Knots((h,)), (Side("periodic"), Side("periodic"), Side(p=1e6), Side(p=1e6)))
    assert values["friction"] == pytest.approx(MU * U / h * L * WIDTH, rel=1e-12)
    assert values["pressure_integral"] == pytest.approx(1e6 * L * WIDTH, rel=1e-12)
    assert values["load"] == pytest.approx(0.0, abs=1e-6) and values["p_ambient"] == 1e6
    assert values["flow"] == pytest.approx(dict.fromkeys(SIDES, 0.0), abs=1e-15)


def test_reformation_round_the_end():
    """Without a groove the cavity of a journal goes on at the widest film, and ends behind it."""
    values = found(load_scene("journal", {"nx": 61, "ny": 15, "round": "periodic", "p_side": 2e5}))
    assert 0 < values["reformation"] < 0.3 * np.pi * 0.1 < 0.5 * np.pi * 0.1 < values["rupture"]


def test_closed_at_the_end():
    """What the wall drags to a closed end is pressed back: h^2 dp/dx = 6 mu U, so the drag is 4 mu U L/h."""
    h = 2e-5
    values = on_sides((20,), Knots((h,)), (Side(), Side("closed"), Side(), Side()))
    assert values["friction"] == pytest.approx(4 * MU * U / h * L, rel=1e-9)
    assert values["load"] == pytest.approx(6 * MU * U / h**2 * L**2 / 2, rel=1e-3)
    assert values["flow"] == pytest.approx({"west": 0.0, "east": 0.0}, abs=1e-15)


def test_three_ranks_find_the_same_places_and_flows(cli):
    """With fewer lines than ranks, so that lines are dealt out too."""
    one, three = (cli("solve", "journal", "--nx", 31, "--ny", 2, "--json", ranks=ranks).json for ranks in (1, 3))
    for key in ("p_max_at", "min_h_at", "force"):
        assert three[key] == pytest.approx(one[key], rel=1e-6)
    for key in ("rupture", "friction", "side_leakage", "cavitated_area", "power_loss", "min_h"):
        assert three[key] == pytest.approx(one[key], rel=1e-6)
    assert three["flow"] == pytest.approx(one["flow"], rel=1e-6)


def test_friction_beside_an_edge_of_any_height():
    """1e17 times the film beyond an edge: what shears both strips agrees with that of the thin one to all digits."""
    film = [{"shape": "constant", "h": 1e-12}, {"shape": "step", "along": "y", "height": 1e5, "at": 4.3e-3}]
    sides = dict.fromkeys(SIDES, 0.0)
    data = {"family": "bearing", "dimension": 2, "L": 0.01, "width": 0.01, "U": 1.0, "nx": 7, "ny": 8, "film": film}
    solution = solve(data | {"sides": sides, "fluid": {"mu": MU}})
    thin = MU * 0.01 * 4.3e-3 / 1e-12
    assert solution.friction == pytest.approx(thin, rel=0.02)
