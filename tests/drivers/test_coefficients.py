"""Journals with grooves, and their stiffness and damping: published rows, differences of solves, laws, ranks, bad input."""

import csv
import math

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.motions import linearised, response
from lcp_lube.drivers.motions.coefficients import coefficients, stability
from lcp_lube.registry import PACKAGE
from lcp_lube.solvers.fas.frozen import Frozen

TABLE = next(
    path
    for folder in (PACKAGE / "published", PACKAGE.parent / "benchmarks" / "published")
    if (path := folder / "dynamics" / "lund_thomsen.csv").is_file()
)
ROWS = [row for row in csv.DictReader(TABLE.read_text().splitlines()) if row["bearing"].startswith("two axial grooves")]
SMALL = {"nx": 144, "ny": 11}


def force(scene):
    """Of the film on the journal, x along the load's line; N."""
    solution = solve(scene, method="active-set")
    assert solution.converged, solution.message
    found = solution.problem.quantities(solution.fields)["force"]
    solution.destroy()
    return np.array(found)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['L_over_D']}-{row['eps']}")
def test_lund_and_thomsen(row):
    """3 % of the greater of the value and 1, as the table has two digits after the point; phi to half a degree."""
    scene = load_scene("two_groove_journal", L_over_D=float(row["L_over_D"]), eccentricity=float(row["eps"]))
    solution = solve(scene)
    values = solution.problem.quantities(solution.fields)
    (found,) = coefficients(scene, solution)
    scale = scene.clearance / values["load"]
    assert values["S"] == pytest.approx(float(row["S"]), rel=0.02)
    assert values["attitude_deg"] == pytest.approx(float(row["phi_deg"]), abs=0.5)
    for name, ours in {
        "Kxx": found.K[0, 0], "Kxy": found.K[0, 1], "Kyx": found.K[1, 0], "Kyy": found.K[1, 1],
        "Cxx": found.C[0, 0] * scene.omega, "Cxy": found.C[0, 1] * scene.omega, "Cyy": found.C[1, 1] * scene.omega,
    }.items():  # fmt: skip
        assert abs(ours * scale - float(row[name])) <= 0.03 * max(abs(float(row[name])), 1.0), name
    # Cavities end in a groove: no void is carried into a full film, and damping is symmetric.
    assert found.C[0, 1] == pytest.approx(found.C[1, 0], rel=1e-6)
    solution.destroy()


@pytest.mark.parametrize(
    "changes",
    [
        {"eccentricity": 0.3},
        {"eccentricity": 0.8, "p_groove": 2e5, "p_end": 1e5},
        {"grooves_deg": [], "p_end": 1e5},
        {"grooves_deg": [], "supply": [{"shape": "circumferential_groove", "length_mm": 10, "p": 2e5}]},
    ],
    ids=["two", "fed", "ring", "fed round"],
)
def test_stiffness_is_what_solves_differ_by(changes):
    """Central differences of two solves, in both directions; the attitude is given, and the load not vertical."""
    scene = load_scene("two_groove_journal", **SMALL, **{"attitude_deg": 40.0, **changes})
    solution = solve(scene, method="active-set")
    along = solution.problem.quantities(solution.fields)["force"]
    (found,) = coefficients(scene, solution)
    solution.destroy()
    beta = math.atan2(-along[1], -along[0])
    turn = np.array([[math.cos(beta), -math.sin(beta)], [math.sin(beta), math.cos(beta)]])
    at = scene.eccentricity * np.exp(1j * math.radians(scene.attitude_deg))
    step = 1e-4
    K = np.empty((2, 2))
    for column, axis in enumerate((1.0, 1j)):
        ends = []
        for sign in (-1.0, 1.0):
            e = at + sign * step * axis
            ends.append(force(scene.model_copy(update={"eccentricity": abs(e), "attitude_deg": math.degrees(np.angle(e))})))
        K[:, column] = -(ends[1] - ends[0]) / (2.0 * step * scene.clearance)
    assert turn.T @ K @ turn == pytest.approx(found.K, abs=1e-6 * np.abs(K).max())


@pytest.mark.parametrize("barus", [0.0, 1e-8])
def test_stiffness_of_a_pad_with_round_dimples(barus):
    """Their faces are made for the cavities, of the film that is displaced too, and of a fluid with a law as of one without."""
    scene = load_scene("dimpled_pad", {"nx": 41, "ny": 31, "film.2.form": "round", "fluid.barus": barus})
    solution = solve(scene)
    assert solution.problem.dry is not None and solution.problem.dry.any()
    thin = solve(load_scene(scene, {"fluid.barus": 1e-16}))
    other = solve(load_scene(scene, {"fluid.barus": 0.0}))
    assert thin.quantities["load"] == pytest.approx(other.quantities["load"], rel=1e-7)
    (found,) = coefficients(scene, solution)
    assert found.K[0, 0] == pytest.approx(-solution.gradient("load", "h_offset")["h_offset"], rel=1e-6)


def test_what_finite_frequency_changes():
    """Nothing where the cavity ends in a groove; where the film forms again inside, the void that is stored counts."""
    two = load_scene("two_groove_journal", **SMALL)
    solution = solve(two, method="active-set")
    slow, fast = coefficients(two, solution, [0.0, two.omega])
    solution.destroy()
    assert pytest.approx(slow.K, rel=1e-6) == fast.K and pytest.approx(slow.C, rel=1e-6) == fast.C
    ring = load_scene("two_groove_journal", **SMALL, grooves_deg=[], p_end=1e5)
    solution = solve(ring, method="active-set")
    slow, slower, fast = coefficients(ring, solution, [0.0, 1e-4 * ring.omega, ring.omega])
    solution.destroy()
    assert pytest.approx(slow.K, rel=1e-3) == slower.K and pytest.approx(slow.C, rel=1e-3) == slower.C
    assert abs(fast.K - slow.K).max() > 1e-3 * abs(slow.K).max()
    assert abs(slow.C[0, 1] - slow.C[1, 0]) > 1e-3 * abs(slow.C).max()


def test_the_scaling_law():
    """Twice the viscosity: pressures, K and C double, the attitude stays; the load is vertical at the attitude found."""
    found = []
    for mu in (0.02, 0.04):
        scene = load_scene("two_groove_journal", **SMALL, mu=mu)
        solution = solve(scene)
        (one,) = coefficients(scene, solution)
        values = solution.problem.quantities(solution.fields)
        assert abs(values["force"][1]) < 1e-7 * abs(values["force"][0])
        found.append((one, values))
        solution.destroy()
    (a, at), (b, bt) = found
    assert pytest.approx(2.0 * a.K, rel=1e-6) == b.K and pytest.approx(2.0 * a.C, rel=1e-6) == b.C
    assert bt["attitude_deg"] == pytest.approx(at["attitude_deg"], abs=1e-5) and bt["S"] == pytest.approx(at["S"], rel=1e-6)


def test_the_elliptical_bearing():
    """Lund and Thomsen's row with preload 0.5: S and attitude to 2 %, coefficients to 2 % of the greater of value and 1."""
    row = next(row for row in csv.DictReader(TABLE.read_text().splitlines()) if row["bearing"].startswith("elliptical"))
    scene = load_scene("lemon_journal")
    solution = solve(scene)
    values = solution.problem.quantities(solution.fields)
    (found,) = coefficients(scene, solution)
    scale = scene.clearance / values["load"]
    solution.destroy()
    assert values["S"] == pytest.approx(float(row["S"]), rel=0.02)
    assert values["attitude_deg"] == pytest.approx(float(row["phi_deg"]), abs=0.5)
    ours = [*found.K.ravel() * scale, *(found.C.ravel() * scale * scene.omega)[[0, 1, 3]]]
    for name, value in zip(("Kxx", "Kxy", "Kyx", "Kyy", "Cxx", "Cxy", "Cyy"), ours, strict=True):
        assert abs(value - float(row[name])) <= 0.02 * max(abs(float(row[name])), 1.0), name


def test_moments_are_odd_in_the_tilt():
    """A shaft tilted the other way is the same bearing seen from its other end; without tilt there is no moment."""
    found = []
    for tilt in (-4e-4, 0.0, 4e-4):
        scene = load_scene("misaligned_journal", **SMALL, attitude_deg=45.0, tilt=tilt, tilt_across=0.5 * tilt)
        solution = solve(scene, method="active-set")
        found.append(solution.problem.quantities(solution.fields))
        solution.destroy()
    back, none, forth = found
    size = np.abs(forth["moment"]).max()
    assert np.add(back["moment"], forth["moment"]) == pytest.approx(0.0, abs=1e-9 * size)
    assert none["moment"] == pytest.approx([0.0, 0.0], abs=1e-9 * size)
    assert back["force"] == pytest.approx(forth["force"], rel=1e-9)
    # The end that comes nearer carries more: the film pushes it back.
    assert forth["moment"][0] < 0 < back["moment"][0]


@pytest.mark.parametrize(
    "changes",
    [
        {"grooves_deg": [80.0, 200.0, 320.0], "p_groove": 2e5, "p_end": 3e4},
        {"grooves_deg": [], "p_end": 1e5},  # film forms again inside
        {"grooves_deg": [80.0, 260.0], "shear": {"law": "eyring", "tau_0": 1e4}},
    ],
    ids=["grooves", "ring", "eyring"],
)
def test_forces_and_moments_with_tilt_are_slopes_of_solves(changes):
    """All sixteen of K, against central differences of the numbers told of a tilted journal, slopes by half the width."""
    place, tilts = 0.4 * np.exp(0.7j), 1e-3 * (0.8 - 0.5j)
    base, stop = {"nx": 48, "ny": 7, **changes}, {"eps1": 1e-11}
    half = 0.5 * load_scene("misaligned_journal", base).side_lengths[1]

    def told(place, tilts):
        e, at, tilt = abs(place), math.degrees(np.angle(place)), {"tilt": tilts.real, "tilt_across": tilts.imag}
        scene = load_scene("misaligned_journal", {**base, "eccentricity": e, "attitude_deg": at, **tilt})
        solution = solve(scene, stopping=stop)
        values = solution.problem.quantities(solution.fields)
        return scene, solution, np.array([*values["force"], *np.divide(values["moment"], half)])

    scene, solution, F = told(place, tilts)
    with solution:
        (found,) = coefficients(scene, solution, tilt=True)
    along = math.atan2(-F[1], -F[0])
    turn = np.kron(np.eye(2), [[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    size, step = np.array([1.0, 1.0, half, half]), 1e-5 * scene.clearance
    slopes = np.zeros((4, 4))
    for k, (e, slope) in enumerate([(1, 0), (1j, 0), (0, 1), (0, 1j)]):
        for sign in (1.0, -1.0):
            moved = told(place + sign * step * e / scene.clearance, tilts + sign * step * slope / half)
            moved[1].destroy()
            slopes[:, k] -= sign * moved[2] / (2.0 * step)
    K = turn @ (found.K / np.outer(size, size)) @ turn.T
    assert np.abs(K - slopes).max() < 1e-6 * np.abs(K).max() and np.abs(K[2:, 2:]).min() > 1e-3 * np.abs(K).max()


def test_the_threshold_of_stability():
    """Lund and Thomsen's rows give 2.35 for L/D = 0.5, S = 1.656."""
    K, C = np.array([[1.69, 5.06], [-2.20, 1.95]]), np.array([[9.93, 2.15], [2.15, 4.80]])
    whirl, threshold = stability(K, C)
    assert threshold == pytest.approx(2.35, abs=0.01) and whirl == pytest.approx(0.51, abs=0.01)
    assert stability(np.eye(2), np.eye(2)) == (None, None)


@pytest.mark.parametrize("effect", [{}, {"shear": {"law": "eyring", "tau_0": 2e5}}], ids=["", "eyring"])
def test_stiffness_of_a_line_is_that_of_the_numbers_told(effect):
    """On few points too: of a pad's level, and of a journal along its eccentricity."""
    pad = {"family": "bearing", "L": 0.1, "U": 4.0, "n": 23, "fluid": {"mu": 0.05, "barus": 2e-8}} | effect
    pad["film"] = [{"shape": "linear", "h_start": 60e-6, "h_end": 30e-6}]
    above, below = (solve(load_scene(pad, {"h_offset": e}), model="full").load for e in (1e-9, -1e-9))
    with solve(load_scene(pad), model="full") as s:
        assert s.coefficients(0.0).K[0, 0] == pytest.approx((below - above) / 2e-9, rel=1e-6)


def test_stiffness_of_a_long_journal_along_its_eccentricity():
    e, c = 1e-6, 5e-5
    above, below = (np.array(solve(load_scene("long_journal", {"n": 37, "eccentricity": 0.5 + k * e})).force) for k in (1, -1))
    with solve(load_scene("long_journal", {"n": 37})) as s:
        phi, K = np.radians(s.attitude_deg), s.coefficients(0.0).K
    moved = K @ np.array([np.cos(phi), np.sin(phi)])
    assert np.hypot(*moved) == pytest.approx(np.hypot(*(above - below)) / (2.0 * e * c), rel=1e-6)


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks(cli, ranks):
    words = ("coefficients", "two_groove_journal", "--set", "nx=72", "--set", "ny=7", "--frequency", "0,100", "--json")
    alone, together = cli(*words), cli(*words, ranks=ranks)
    assert alone.status == together.status == 0
    for a, b in zip(alone.json["coefficients"], together.json["coefficients"], strict=True):
        for name in ("K", "C"):
            assert np.array(b[name]) == pytest.approx(np.array(a[name]), abs=1e-6 * np.abs(a[name]).max())


def test_a_table_for_rotor_programs(cli, tmp_path):
    """In its axes, y up and the load along -y: our x is -y, our y is x; the load is carried at every speed."""
    words = ("two_groove_journal", "--set", "nx=144", "--set", "ny=11", "--set", "balance.load=2000")
    done = cli("coefficients", *words, "--speeds", "2000:4000:2", "--output", "b.csv")
    assert done.status == 0, done.err
    rows = list(csv.DictReader((tmp_path / "b.csv").read_text().splitlines()))
    one = cli("coefficients", *words, "--set", "speed_rpm=4000", "--json").json
    (xx, xy), (yx, yy) = one["coefficients"][0]["K"]
    last = {name: float(value) for name, value in rows[1].items()}
    assert last["frequency"] == pytest.approx(4000 * math.pi / 30) and one["load"] == pytest.approx(2000, rel=1e-5)
    for name, value in {"kxx": yy, "kyy": xx, "kxy": -yx, "kyx": -xy}.items():
        assert last[name] == pytest.approx(value, rel=1e-4), name


def test_ross_takes_the_table(cli, tmp_path):
    ross = pytest.importorskip("ross")
    words = ("two_groove_journal", "--set", "nx=144", "--set", "ny=11", "--speeds", "2000:4000:2", "--output", "b.csv")
    assert cli("coefficients", *words).status == 0
    rows = list(csv.DictReader((tmp_path / "b.csv").read_text().splitlines()))
    ross.BearingElement(n=0, **{name: [float(row[name]) for row in rows] for name in rows[0]})


def test_text_and_bad_input(cli):
    done = cli("coefficients", "journal", "--nx", 60, "--ny", 15)
    assert done.status == 0 and "Kxy" in done.out and "whirl ratio" in done.out
    for words, message in (
        (("problem1", "--tilt"), "--tilt is of journals"),
        (("squeeze",), "coefficients are of films"),
        (("dynamic_journal",), "leave [motion] out"),
        (("problem1", "--plot", "a.png"), "--speeds FROM:TO:N"),
        (("journal", "--frequency", "1,1e300"), "--frequency 1e+300"),
        (("journal", "--speeds", "1:2:2"), "is no journal with a speed_rpm"),
        (("journal", "--frequency", "a"), "numbers in rad/s"),
        (("two_groove_journal", "--set", "groove_deg=179", "--set", "grooves_deg=[0,90]"), "overlap"),
        (("two_groove_journal", "--set", "grooves_deg=[]"), "p_end > 0"),
        (("two_groove_journal", "--set", "balance.load=1e3", "--set", "balance.vary=mu"), "which follows from the load"),
    ):
        done = cli("coefficients", *words)
        assert done.status == 2 and message in done.lines[0] and len(done.lines) == 1


def test_a_frequency_below_zero():
    scene = load_scene("journal", nx=30, ny=6)
    with solve(scene) as solution, pytest.raises(InputError, match="--frequency -1: numbers from 0"):
        coefficients(scene, solution, [-1.0])


def test_grooves_give_what_the_ends_lose():
    scene = load_scene("two_groove_journal", **SMALL, p_groove=2e5)
    solution = solve(scene)
    values = solution.problem.quantities(solution.fields)
    # Half a spacing lies between the ends and the outermost faces; the flow out of the outermost cells is what balances.
    _, _, south, north = solution.problem.boundary_flows(solution.fields["p"], solution.fields["r"])
    leaving = 0.5 * solution.problem.grid.spacing[1] * (north - south)
    assert sum(values["groove_flow"]) == pytest.approx(leaving, rel=1e-9)
    assert solution.certificate.holds and min(values["groove_flow"]) > 0
    solution.fields["r"][0] = 0.3  # in a groove, which is full
    assert not solution.problem.certify(solution.fields, 1e-8).holds
    solution.destroy()


@pytest.mark.parametrize(
    ("name", "changes"),
    [("ring_journal", {}), ("two_groove_journal", {}), ("dimpled_pad", {}), ("hybrid_journal", {}), ("misaligned_journal", {})],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_multigrid_has_the_coefficients_of_the_matrix(monkeypatch, name, changes):
    """At rest and at frequencies, supplies that follow, films solved on half their width and whole ones."""
    scene = load_scene(name, nx=96, ny=41, **changes)
    solution = solve(scene)
    found = []
    for least in (10**9, 100):
        for module in (linearised, response):
            monkeypatch.setattr(module, "SMALL", least)
        found.append(coefficients(scene, solution, [0.0, 1.0, 300.0]))
    for matrix, multigrid in zip(*found, strict=True):
        assert pytest.approx(matrix.K, abs=1e-8 * np.abs(matrix.K).max()) == multigrid.K
        assert pytest.approx(matrix.C, abs=3e-8 * np.abs(matrix.C).max()) == multigrid.C
    solution.destroy()


@pytest.mark.parametrize("effects", [{}, {"elastic": {"compliance": 1e-14}}], ids=["rigid", "soft"])
def test_a_wall_that_moves_to_smaller_x(effects):
    """The film that was turned round answers as it stands."""
    found = []
    for U, ends, pocket in ((2.0, (40, 20), [2, 8]), (-2.0, (20, 40), [12, 18])):
        film = [
            {"shape": "linear", "h_start_um": ends[0], "h_end_um": ends[1]},
            {"shape": "pocket", "depth_um": 15, "x_mm": pocket},
        ]
        data = {"family": "bearing", "L_mm": 20, "U": U, "n": 60, "film": film, "fluid": {"mu": 0.02, "barus": 2e-8}, **effects}
        with solve(data, p_in=3e5 if U > 0 else 0.0, p_out=0.0 if U > 0 else 3e5) as solution:
            found += solution.coefficients([0.0, 500.0])
    for one, other in zip(found[:2], found[2:], strict=True):
        assert (pytest.approx(one.K, rel=1e-6), pytest.approx(one.C, rel=1e-6)) == (other.K, other.C)


def test_multigrid_on_ranks(cli):
    scene = load_scene("dimpled_pad", nx=191, ny=221)
    found = cli("coefficients", "dimpled_pad", "--nx", 191, "--ny", 221, "--frequency", "0,200", "--json", ranks=2).json
    with solve(scene) as solution:
        for here, there in zip(coefficients(scene, solution, [0.0, 200.0]), found["coefficients"], strict=True):
            assert there["K"][0][0] == pytest.approx(here.K[0, 0], rel=1e-6)
            assert there["C"][0][0] == pytest.approx(here.C[0, 0], rel=1e-6)


def test_coefficients_cost_some_cycles(monkeypatch):
    """Two pairs of right-hand sides, some ten cycles each, and no matrix."""
    scene = load_scene("problem4", n=255)
    solution = solve(scene)
    monkeypatch.setattr(linearised.Linear, "_factors", property(lambda self: pytest.fail("a matrix was factored")))
    cycles = []
    solved = Frozen._gmres
    monkeypatch.setattr(Frozen, "_gmres", lambda self, *given: (solved(self, *given), cycles.append(self.work))[0])
    (found,) = coefficients(scene, solution)
    assert found.K[0, 0] > 0.0 and len(cycles) == 2 and cycles[-1] <= 24
    solution.destroy()
