"""Lines: coefficients from integrals, and numbers that the grid does not spoil, against exact solutions."""

import numpy as np
import pytest
from films import MU, FilmScene, L, Pieces, U, dense, knots, random_films
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from lcp_lube import InputError, load_scene, solve
from lcp_lube.problems.film.exact import exact_solution
from lcp_lube.problems.film.fluid import Law
from lcp_lube.problems.film.integrals import LineIntegrals
from lcp_lube.problems.film.known import known_of
from lcp_lube.problems.film.line import solve_line, solve_points
from lcp_lube.problems.film.shapes import Along, Block, Sum

EXACT = ("problem1", "problem2", "problem3", "parabolic_slider", "pocketed_pad", "long_journal")
PRECISE = {"eps1": 1e-12}


def answer(scene, **how):
    solution = solve(scene, **{"method": "active-set", "nested": False, "stopping": PRECISE, **how})
    assert solution.converged, solution.message
    values, problem = solution.quantities, solution.problem
    return values, problem


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("n", [7, 100])
def test_numbers_are_exact_on_any_grid(name, n):
    """The film's own numbers, not the grid's: the certificate's digits are what is left."""
    scene = load_scene(name, {"n": n, "scheme": "face"})
    exact = scene.exact()
    values, problem = answer(scene)
    assert values["pressure_integral"] == pytest.approx(exact.load, rel=1e-9)
    assert values["p_max"] - problem.p_c == pytest.approx(exact.p_max, rel=1e-9)
    assert values["p_max_at"][0] == pytest.approx(exact.x_max, abs=1e-7 * problem.grid.lengths[0])
    assert 2 * values["flow"]["east"] == pytest.approx(exact.Q, rel=1e-10)
    for front in ("rupture", "reformation"):
        place = getattr(exact, front)
        assert values[front] == (None if place is None else pytest.approx(place, rel=1e-9))


def test_random_films_on_coarse_grids():
    """Cavities at inlets, at edges, several in a cell: with 1 to 40 points the numbers are those of the film."""
    rng = np.random.default_rng(3)
    for scene, exact in random_films(60, seed=21):
        scene = scene.model_copy(update={"n": int(rng.integers(1, 41)), "scheme": "face"})
        values, _ = answer(scene)
        scale = 6 * MU * U * L / 5e-6**2  # what pressures are the difference of
        assert values["pressure_integral"] == pytest.approx(exact.load, abs=1e-11 * scale * L), scene.name
        assert values["p_max"] == pytest.approx(exact.p_max, abs=1e-10 * scale), scene.name
        if exact.load > 1e-6 * scale * L:
            for front in ("rupture", "reformation"):
                place = getattr(exact, front)
                assert values[front] == (None if place is None else pytest.approx(place, abs=1e-6 * L)), scene.name


@pytest.mark.parametrize("U", [5.0, 0.05])
def test_forty_offsets_of_an_edge_in_a_cell(U):
    """No place of the edges within their cells is worse than another: none leaves an error."""
    for n in (20,):
        dx = L / (n + 1)
        for part in np.arange(40) / 40:
            edges = (8 + part) * dx, (15 + part) * dx
            film = Sum([Along("linear", 2e-5, 1e-5, 0.0, L), Block(1.5e-5, edges, (-np.inf, np.inf))])
            exact = exact_solution(film, L, MU, U, 1e5, 1e5)
            values, _ = answer(FilmScene.of(film, n=n, U=U, p_a=1e5, p_b=1e5))
            assert values["pressure_integral"] == pytest.approx(exact.load, rel=1e-9)


def test_pressures_of_a_full_film_are_exact_at_the_points():
    """Resistances in series: whatever lies between two points, a jump that nothing tells of included."""

    def film(x, y=0.0):
        x = np.asarray(x) + 0.0 * np.asarray(y)
        return np.where(np.abs(x - 0.0317) < 1e-4, 4e-6, 2e-5 * (1.2 + np.sin(300 * x) / 9))  # a ridge far below a cell

    known = exact_solution(Told(film), L, MU, 0.01, 1e6, 2e6)
    scene = FilmScene.of(film, n=9, U=0.01, p_a=1e6, p_b=2e6)
    solution = solve(scene, stopping=PRECISE)
    p = solution.fields["p"] * 1e6
    assert known.rupture is None
    np.testing.assert_allclose(p, known.p(solution.problem.grid.x[0]), rtol=0, atol=1e-9 * known.p_max)
    assert solution.quantities["pressure_integral"] == pytest.approx(known.load, rel=1e-9)


class Told:
    """A film whose edges are told."""

    def __init__(self, film):
        self.film = film

    def __call__(self, x, y=0.0):
        return self.film(x, y)

    def breakpoints(self):
        extrema = (np.arange(0, 12) + 0.5) * np.pi / 300
        return tuple(sorted([0.0316, 0.0318, *(float(t) for t in extrema if t < L)]))


@settings(max_examples=40, deadline=None)
@given(knots(1000.0), st.integers(1, 12), st.sampled_from([0.0, 1e5, 3e6]), st.sampled_from([0.0, 3e6]), st.floats(0, 1))
def test_the_discrete_solution_is_known(film, n, p_a, p_b, mix):
    """Its balances are zero, it is complementary, and the matrices are M-matrices, any mix of their columns too."""
    problem = FilmScene.of(film, n=n, p_a=p_a, p_b=p_b).build()
    p, r, _ = solve_points(problem.integrals.parts, MU, U, p_a, p_b)
    s = problem.scheme
    assert p.min() >= 0 and r.min() >= 0 and r.max() < 1 and not (p * r).any()
    p = p / problem.p_unit
    terms = (s.k_W + s.k_E).ravel() * (p.max() + max(p_a, p_b) / problem.p_unit) + np.abs(s.b_C).ravel()
    assert np.abs(problem.balance(p, r)).max() <= 1e-12 * terms.max()
    A, B = dense(problem.A), dense(problem.B)
    theta = np.where(np.arange(n) % 2, mix, 1 - mix)
    J = A / np.diag(A) * theta - B / np.abs(np.diag(B)) * (1 - theta)
    off = J - np.diag(np.diag(J))
    assert (off <= 0).all() and (np.diag(J) > 0).all()
    for column, diagonal in ((A, np.diag(A)), (-B, -np.diag(B))):
        assert (column.sum(axis=0) >= -1e-12 * diagonal).all()
    problem.destroy()


def test_a_wrong_answer_reads_wrong():
    """The grid's error is taken off, not the answer's."""
    scene = load_scene("problem2", {"scheme": "face", "n": 40})
    solution = solve(scene, method="active-set", nested=False, stopping=PRECISE)
    right, problem = solution.quantities, solution.problem
    p = solution.fields["p"] * 1.01
    wrong = problem.quantities({"p": p, "r": solution.fields["r"]})
    assert wrong["pressure_integral"] == pytest.approx(1.01 * right["pressure_integral"], rel=2e-3)
    assert wrong["p_max"] == pytest.approx(1.01 * right["p_max"], rel=1e-3)
    moved = problem.quantities({"p": np.roll(solution.fields["p"], 5), "r": np.roll(solution.fields["r"], 5)})
    assert abs(moved["rupture"] - right["rupture"]) > 3 * problem.grid.spacing[0]


@pytest.mark.parametrize("r_in", [0.7, 0.9])
def test_void_that_enters(r_in):
    """U h(0) (1 - r_in) flows; the numbers of a coarse grid are those of a fine one, and those of the other direction."""
    film = {"shape": "parabola", "h_min": 1e-5, "h_max": 3e-5}
    base = {"family": "bearing", "L": 0.1, "U": 5.0, "fluid": {"mu": 0.015}, "film": [film]}
    found = []
    for n in (37, 400):
        sides = {"west": {"p": 0.0, "r": r_in}, "east": 1e5}
        solution = solve({**base, "n": n, "sides": sides})
        found.append(solution.quantities)
    turned = {"west": 1e5, "east": {"p": 0.0, "r": r_in}}
    found.append(solve({**base, "n": 50, "U": -5.0, "sides": turned}).quantities)
    for values in found:
        assert values["load"] == pytest.approx(found[1]["load"], rel=1e-7)
        assert abs(values["flow"]["east"]) == pytest.approx(0.5 * 5.0 * 3e-5 * (1 - r_in), rel=1e-9)


def test_film_at_rest_needs_no_speed():
    film = Pieces("smooth", (0.0, 0.03, L), (1e-5, 3e-5, 5e-6))
    line = solve_line(LineIntegrals(film, np.linspace(0, L, 5)), MU, 0.0, 1e5, 3e5)
    exact = exact_solution(film, L, MU, 0.0, 1e5, 3e5)
    assert line.integral(np.asarray) == pytest.approx(exact.load, rel=1e-12)
    assert line.fronts == ([], []) and line.cavitated == 0.0


def test_film_that_touches_between_points_is_refused():
    def film(x, y=0.0):
        return np.where(np.abs(np.asarray(x) - 0.0303) < 2e-3, 0.0, 1e-5) + 0.0 * np.asarray(y)

    with pytest.raises(InputError, match=r"film 0 m at x = 0.0[23].* m: it must be positive everywhere"):
        FilmScene.of(film, n=9).build()


def test_where_nothing_is_known():
    """Other schemes are read as before."""
    assert known_of(load_scene("problem1").build()) is None


@pytest.mark.parametrize("U", [1.0, -1.0])
@pytest.mark.parametrize("sides", [{"west": "closed", "east": 1e5}, {"west": 1e5, "east": "closed"}])
def test_closed_ends(sides, U):
    """Nothing flows: what a wall brings is pressed back, p = p_a + Int 6 mu U/h^2; the other wall runs dry up to that."""
    film = [{"shape": "linear", "h_start": 2e-5, "h_end": 1e-5}, {"shape": "pocket", "depth": 1e-5, "x": [4e-3, 9e-3]}]
    data = {"family": "bearing", "L": 0.02, "U": U, "fluid": {"mu": 0.02}, "film": film, "scheme": "face", "sides": sides}
    found = []
    for n in (3, 12, 300):
        values, _ = answer(load_scene({**data, "n": n}))
        found.append([values[name] for name in ("load", "p_max", "friction", "cavitated_area")])
        assert abs(values["flow"]["east"]) < 1e-15 and abs(values["flow"]["west"]) < 1e-15
    assert found[0] == pytest.approx(found[2], rel=1e-9, abs=1e-9) and found[1] == pytest.approx(found[2], rel=1e-9, abs=1e-9)
    if (sides["west"] == "closed") == (U < 0):
        x = (np.arange(200_000) + 0.5) * 1e-7
        h = 2e-5 - 5e-4 * x + np.where((x > 4e-3) & (x < 9e-3), 1e-5, 0.0)
        assert values["p_max"] == pytest.approx(1e5 + np.sum(6 * 0.02 / h**2) * 1e-7, rel=1e-8)


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks(cli, ranks):
    arguments = ("solve", "pocketed_pad", "--n", "40", "--json", "--eps1", "1e-12")
    one, more = cli(*arguments).json, cli(*arguments, ranks=ranks).json
    for name in ("load", "friction", "p_max", "rupture", "reformation"):
        assert more[name] == pytest.approx(one[name], rel=1e-9)


@pytest.mark.parametrize("changes, cell", [({"columns": 5, "rows": 2}, "2 mm \\(5 along x\\)"), ({"rows": 8}, "1.25 mm")])
def test_dimples_that_overlap_are_refused(changes, cell):
    dimples = {"shape": "dimples", "depth_um": 2, "size_mm": 2.1, "columns": 2, "rows": 2, **changes}
    film = [{"shape": "constant", "h_um": 2}, dimples]
    scene = load_scene({"family": "bearing", "dimension": 2, "L_mm": 10, "U": 1.0, "fluid": {"mu": 0.02}, "film": film})
    with pytest.raises(InputError, match=f"dimples of size 2.1 mm in cells of {cell}.* would overlap"):
        scene.build()


WAVE = {"shape": "formula", "unit": "um", "h": "10*(1 + 0.6*cos(20*pi*(x - 0.031)))"}  # of a ring of 0.1 m
GROOVES = [{"x": [0.0131, 0.0197], "p": 2e5}, {"x": [0.0911, 0.0913], "restrictor": "capillary", "K": 4e-12, "p_s": 3e6}]
TOLD = ("pressure_integral", "load", "friction", "p_max", "cavitated_area", "rupture", "reformation", "supply_p", "supply_flow")


def supplied(n, sides="periodic", supply=GROOVES, U=2.0, **fluid):
    scene = {"family": "bearing", "L": 0.1, "n": n, "U": U, "scheme": "face", "film": [WAVE], "fluid": {"mu": 0.015, **fluid}}
    solution = solve({**scene, "sides": {"west": sides, "east": sides}, "supply": supply}, stopping=PRECISE)
    assert solution.converged, solution.message
    return solution.quantities


@pytest.mark.parametrize("sides, fluid", [("periodic", {}), (1e5, {}), (1e5, {"barus": 2e-9})])
def test_supplies_on_any_grid(sides, fluid):
    """A groove between two points, one across several, a pressure that follows: numbers are the film's on coarse grids too."""
    coarse, fine = (supplied(n, sides, **fluid) for n in (11, 200))
    for name in TOLD:
        assert coarse[name] == pytest.approx(fine[name], rel=1e-8), name
    p, flow = coarse["supply_p"][1], coarse["supply_flow"][1]
    assert flow == pytest.approx(4e-12 * (3e6 - p), rel=1e-9)
    given = supplied(300, sides, [GROOVES[0], {"x": GROOVES[1]["x"], "p": p}], **fluid)
    assert given["supply_flow"][1] == pytest.approx(flow, rel=1e-8)


def test_a_ring_with_a_groove_is_the_film_between_its_edges():
    """Against the line that begins where the groove ends, whose solution `exact` has."""
    a, b = 0.0231, 0.0297
    found = supplied(60, supply=[{"x": [a, b], "p": 2e5}])

    def film(x, y=0.0):
        return 1e-5 * (1.0 + 0.6 * np.cos(20 * np.pi * (np.asarray(x) + b - 0.031)))

    extrema = [t for k in range(-2, 5) if 0 < (t := 0.031 + 0.05 * k - b) < 0.1 - (b - a)]
    film.breakpoints = lambda: tuple(extrema)
    exact = exact_solution(film, 0.1 - (b - a), 0.015, 2.0, 2e5, 2e5)
    assert found["pressure_integral"] == pytest.approx(exact.load + 2e5 * (b - a), rel=1e-9)
    assert found["p_max"] == pytest.approx(exact.p_max, rel=1e-9)
    assert found["rupture"] == pytest.approx((exact.rupture + b) % 0.1, rel=1e-9)
    assert found["reformation"] == pytest.approx((exact.reformation + b) % 0.1, rel=1e-9)
    back = [supplied(n, supply=[{"x": [a, b], "p": 2e5}], U=-2.0)["friction"] for n in (17, 60)]
    assert back[0] == pytest.approx(back[1], rel=1e-9)


def test_viscosity_by_pressure():
    """Barus' fluid: p = -log(1 - b q)/b of the constant fluid's q, whose solution is known."""
    b, sides = 2e-8, {"west": 1e5, "east": 1e5}
    scene = {"family": "bearing", "film": [WAVE], "L": 0.1, "U": 0.2, "scheme": "face", "sides": sides}
    found, finer = (
        solve({**scene, "n": n, "fluid": {"mu": 0.015, "barus": b}}, stopping=PRECISE).quantities for n in (19, 400)
    )
    q = -np.expm1(-b * 1e5) / b

    def film(x, y=0.0):
        return 1e-5 * (1.0 + 0.6 * np.cos(20 * np.pi * (np.asarray(x) - 0.031)))

    film.breakpoints = lambda: (0.031, 0.081)
    exact = exact_solution(film, 0.1, 0.015, 0.2, q, q)
    p = -np.log1p(-b * exact.p((np.arange(200_000) + 0.5) * 5e-7)) / b
    assert found["pressure_integral"] == pytest.approx(np.sum(p) * 5e-7, rel=1e-7)
    assert found["rupture"] == pytest.approx(exact.rupture, rel=1e-9)
    for name in ("pressure_integral", "friction", "p_max"):
        assert found[name] == pytest.approx(finer[name], rel=1e-8)


@pytest.mark.parametrize("barus, source", [(0.0, {"p": 2e6}), (2e-9, {"flow": 4e-6})])
def test_density_that_follows_the_pressure(barus, source):
    """p' = 6 mu(p) (U/h^2 - Q/(rho h^3)) by SciPy's integrator upstream meets the west side; U < 0 and a supply."""
    h_1, h_2, L, U, p_b = 3e-6, 1.5e-6, 0.01, 5.0, 3e7
    fluid, law = {"mu": 0.02, "p_c": 0.0, "density": "dowson-higginson", "barus": barus}, Law(barus, True)
    film = [{"shape": "linear", "h_start": h_1, "h_end": h_2}]
    base = {"family": "bearing", "L": L, "U": U, "fluid": fluid, "film": film, "scheme": "face"}
    base["sides"] = {"west": 0, "east": p_b}

    def along(x, y, Q):
        h, mu = h_1 + (h_2 - h_1) * x / L, 0.02 * law.viscosity(y[0])
        slope = 6 * mu * (U / h**2 - Q / (law.density(y[0]) * h**3))
        return slope, y[0], mu * U / h + 0.5 * h * slope

    def upstream(Q):
        return solve_ivp(along, (L, 0.0), [p_b, 0.0, 0.0], args=(Q,), rtol=1e-11, atol=1e-5, method="DOP853").y[:, -1]

    for n in (7, 100):
        values, _ = answer(load_scene({**base, "n": n}), model="full")
        p_a, load, friction = upstream(2 * values["flow"]["east"])
        assert p_a == pytest.approx(0.0, abs=1e-8 * values["p_max"])
        assert values["load"] == pytest.approx(-load, rel=1e-8) and values["friction"] == pytest.approx(-friction, rel=1e-8)
    supply = [{"x": [3e-3, 4e-3], **source}]
    turned = [answer(load_scene({**base, "U": -U, "supply": supply, "n": n}), model="full")[0] for n in (9, 100)]
    for name in ("load", "friction", "p_max", "supply_p", "cavitated_area"):
        assert turned[0][name] == pytest.approx(turned[1][name], rel=1e-8), name


@pytest.mark.parametrize(
    "more",
    [
        {"shear": {"law": "eyring", "tau_0": 2e4}, "fluid": {"barus": 2e-9}},
        {"shear": {"law": "carreau", "time": 1e-6, "n": 0.6}, "viscosity": {"factor": "1 + 0.5*sin(300*x)"}},
        {"roelands": {"z": 0.4}, "fluid": {"density": "dowson-higginson"}},
    ],
)
def test_effects_of_the_place_alone(more):
    """Viscosities by shear, pressure and place: 9 points have the numbers of 70, of a film that cavitates in a pocket."""
    film = [{"shape": "linear", "h_start": 3e-6, "h_end": 4e-6}, {"shape": "pocket", "depth": 6e-6, "x": [4e-3, 7e-3]}]
    base = {"family": "bearing", "L": 0.01, "U": 5.0, "film": film, "scheme": "face", "sides": {"west": 1e5, "east": 3e7}}
    scene = {**base, **more, "fluid": {"mu": 0.02, "p_c": 0.0, **more.get("fluid", {})}}
    few, many = (answer(load_scene({**scene, "n": n}), model="full")[0] for n in (9, 70))
    assert few["cavitated_area"] > 1e-3
    for name in ("load", "friction", "p_max"):
        assert few[name] == pytest.approx(many[name], rel=1e-8), name
    for name in ("cavitated_area", "rupture", "reformation"):
        assert few[name] == pytest.approx(many[name], abs=1e-8 * base["L"]), name


def test_a_front_at_the_side_where_the_density_is_looked_for():
    """The film narrows from its first point on; 5e-324 m beside it was a front, and a cell without length."""
    film = {"shape": "parabola", "h_min": 3.7595363548060405e-06, "h_max": 2.8612717949006014e-06}
    scene = {"family": "bearing", "dimension": 1, "L": 0.01677224539078192, "U": -0.4764565191796369, "nx": 5, "film": film}
    scene |= {"fluid": {"mu": 0.06983319854437521, "p_supply": 1312596.75150687, "density": "dowson-higginson"}}
    values, _ = answer(load_scene(scene | {"sides": {"east": 0.0}}))
    back = film | {"h_max": film["h_max"] * (1 + 1e-6)}
    near, _ = answer(load_scene(scene | {"film": back, "sides": {"east": 0.0}}))
    assert values["pressure_integral"] == pytest.approx(near["pressure_integral"], rel=1e-5)
    assert values["reformation"] == pytest.approx(near["reformation"], rel=1e-4)
