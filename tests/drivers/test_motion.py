"""Films that go on in time: exact pressures, orders, balance, sides, ranks, checkpoints, journals that are free, bad input."""

import csv
import math
import signal
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from conftest import ENVIRONMENT
from marches import WEDGE, taken_up

from lcp_lube import InputError, load_scene, solve

PLATES = {
    "family": "bearing",
    "L": 1.0,
    "U": 0.0,
    "n": 40,
    "p_unit": 1.0,
    "fluid": {"mu": 1 / 6, "p_supply": 0.5},
    "film": {"shape": "formula", "h": "0.375 + 0.125*cos(4*pi*t)"},
    "motion": {"t_end": 0.4, "steps": 40, "start": "full"},
}
RING = {
    "family": "bearing",
    "dimension": 2,
    "L": 0.3,
    "width": 0.1,
    "U": 10.0,
    "nx": 24,
    "ny": 5,
    "fluid": {"mu": 0.02, "p_supply": 1e5},
    "film": {"shape": "journal", "c": 1e-4, "eccentricity": 0.5},
    "sides": {"west": "periodic", "east": "periodic"},
}


def march(scene, method="auto", **changes):
    solution = solve(load_scene(scene, changes), method=method)
    assert solution.converged, solution.message
    solution.destroy()
    return solution


@pytest.mark.parametrize("scheme, order", [("euler", 1), ("bdf2", 2)])
def test_the_pressure_between_plates(scheme, order):
    """p = p_side - h' x (1 - x)/h^3, exact in x: what is left is the formula's error."""
    errors = []
    for steps in (20, 40, 80):
        # Plates that approach: the film stays full.
        film = {"film": {"shape": "formula", "h": "0.375 + 0.125*cos(2*pi*t)"}}
        s = march(PLATES | film, **{"motion.scheme": scheme, "motion.steps": steps})
        h, rate = 0.375 + 0.125 * math.cos(0.8 * math.pi), -0.25 * math.pi * math.sin(0.8 * math.pi)
        x = np.arange(1, 41) / 41
        errors.append(np.abs(s.fields["p"] - (0.5 - rate * x * (1 - x) / h**3)).max())
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx(order, abs=0.15) and errors[-1] < 0.15


def test_plates_are_the_squeeze_scene():
    s = march(PLATES, **{"fluid.p_supply": 0.025, "motion.steps": 60})
    other = march("squeeze", n=40, steps=60, t_end=0.4)
    assert s.fields["r"].max() > 0.1
    np.testing.assert_allclose(s.fields["p"], other.fields["p"] * 0.025, rtol=0, atol=1e-11)
    np.testing.assert_allclose(s.fields["r"], other.fields["r"], rtol=0, atol=1e-11)


def test_a_film_that_rests_stays_at_its_steady_answer():
    still = WEDGE | {"film": WEDGE["film"][:1], "scheme": "nodal"}  # face knows more of a line's film where nothing is stored
    s, steady = march(still), march(still | {"motion": None})
    np.testing.assert_allclose(s.fields["p"], steady.fields["p"], rtol=0, atol=1e-9 * steady.fields["p"].max())
    assert s.load == pytest.approx(steady.load, rel=1e-9) and s.iterations_per_step < 1.5
    full = march(still | {"motion": {"t_end": 2.0, "steps": 60, "start": "full"}})  # however it began
    assert full.load == pytest.approx(steady.load, rel=1e-6)


SIDES = {
    "open": {},
    "closed": {"sides": {"east": "closed"}},
    "to smaller x": {"U": -1.0},
    "at rest": {"U": 0.0},
    "periodic": {"sides": {"west": "periodic", "east": "periodic"}, "dimension": 2, "nx": 16, "ny": 6},
    "mirror": {"dimension": 2, "width_mm": 8, "nx": 15, "ny": 7},
    "symmetry": {"dimension": 2, "width_mm": 8, "nx": 15, "ny": 6, "sides": {"south": "symmetry"}},
    "dimples": {"film": [{"shape": "constant", "h_um": 2}, {"shape": "dimples", "depth_um": 2, "size_mm": 1.1, "columns": 4,
                          "form": "square", "moves": True}]},
    "liquid": {"fluid": {"mu": 0.01, "p_supply": 1e5, "barus": 1e-9}},
}  # fmt: skip


@pytest.mark.parametrize("name", SIDES)
def test_balance(name):
    """What comes in is stored, in every step and in the whole run; the content says so too, by itself."""
    s = march(WEDGE | SIDES[name])
    assert s.mass_defect <= 1e-10 and s.mass_defect_run <= 1e-10
    assert max(row["cavitated_fraction"] for row in s.history) > 0.05
    euler = march(WEDGE | SIDES[name], **{"motion.scheme": "euler"}).history
    flowed = sum(row["dt"] * (row["inflow"] - row["outflow"]) for row in euler[1:])
    gained = euler[-1]["volume"] - euler[0]["volume"]
    assert gained == pytest.approx(flowed, rel=0, abs=1e-9 * euler[0]["volume"])


@pytest.mark.parametrize("U", [1.0, -1.0])
@pytest.mark.parametrize("at_mm", [0.05, 3.96, 2.0])
@pytest.mark.parametrize(
    "more", [{}, {"dimension": 2, "width_mm": 2, "nx": 40, "ny": 9, "sides": {"south": "periodic", "north": "periodic"}}]
)
def test_an_edge_beside_the_seam_of_a_ring_is_one_anywhere(U, at_mm, more):
    """What its cell holds is the same whichever way the wall moves; what a restrictor fills it with is counted."""
    film = [{"shape": "constant", "h": 2e-5}, {"shape": "step", "height": 1e-5, "at_mm": at_mm}]
    ring = {"family": "bearing", "L": 0.004, "U": U, "n": 40, "fluid": {"mu": 0.02}, "film": film}
    ring |= {**more, "sides": {"west": "periodic", "east": "periodic", **more.get("sides", {})}}
    inlet = {"x_mm": [1.0, 1.2], "restrictor": "capillary", "p_s": 1e6, "K": 1e-11, "backflow": True}
    ring["supply"] = [{**inlet, **({"y_mm": [0.5, 1.5]} if more else {})}]
    with solve({**ring, "motion": {"t_end": 2e-3, "steps": 3, "fill": 0.6, "scheme": "euler"}}) as s:
        assert s.converged and s.mass_defect_run < 1e-10
        assert s.history[-1]["volume"] >= (1.0 - 1e-9) * s.history[0]["volume"]


PLANE = {"dimension": 2, "width_mm": 8, "nx": 31, "ny": 16}


@pytest.mark.parametrize("name", ["open", "closed", "to smaller x", "at rest", "periodic", "symmetry", "dimples"])
def test_multigrid_takes_steps(name):
    """The answer of the active set, with as little lost, on every kind of side."""
    plane = {} if name == "dimples" else PLANE
    scene = WEDGE | plane | {key: value for key, value in SIDES[name].items() if key not in plane}
    one, two = march(scene), solve(load_scene(scene), method="fas")
    assert two.converged and two.settings["method"] == "fas" and two.mass_defect < 1e-12 and two.mass_defect_run < 1e-12
    np.testing.assert_allclose(two.fields["p"], one.fields["p"], rtol=0, atol=5e-5 * one.fields["p"].max())
    np.testing.assert_allclose(two.fields["r"], one.fields["r"], rtol=0, atol=1e-4)
    two.destroy()


def test_smooth_motion_takes_a_cycle_and_a_half_a_step():
    """What a cycle leaves is far below the error of the formula; to the last digit if asked."""
    scene = WEDGE | PLANE | {"motion": {"t_end": 0.002, "steps": 20}}  # of 200 a period
    exact = march(scene, **{"motion.steps": 80}).load
    loads = {}
    for method, rest in (("active-set", None), ("fas", 0.05), ("fas", 0.0)):
        s = solve(load_scene(scene), method=method, options={} if rest is None else {"rest": rest})
        assert s.converged
        loads[rest] = s.load
        if rest:  # the first two steps know of no motion
            assert np.mean([row["iterations"] for row in s.history[2:]]) <= 1.2
        s.destroy()
    assert abs(loads[0.05] - loads[None]) < 0.05 * abs(loads[None] - exact)
    assert loads[0.0] == pytest.approx(loads[None], rel=1e-9)


def test_a_wall_that_moves_the_other_way_is_the_mirror_image():
    moves = {"shape": "formula", "unit": "um", "h": "0.3*sin(300*t)*(x/0.01 - 0.5)"}
    film = [{"shape": "linear", "h_start_um": 3, "h_end_um": 1}, moves]
    there = march(WEDGE | {"film": film})
    film = [{"shape": "linear", "h_start_um": 1, "h_end_um": 3}, {**moves, "h": "-0.3*sin(300*t)*(x/0.01 - 0.5)"}]
    back = march(WEDGE | {"film": film, "U": -1.0})
    np.testing.assert_allclose(back.fields["p"][::-1], there.fields["p"], rtol=0, atol=1e-9)
    assert there.load == pytest.approx(back.load, rel=1e-9)


def test_a_film_without_oil_loses_none():
    """No oil comes in past a closed side: what roundings leave of it is not a share of what was lost."""
    film = [
        {"shape": "journal", "c": 1.6540255867445064e-06, "eccentricity": 0.7249977073788991},
        {"shape": "formula", "h": "3.308e-07*(1+sin(56.8*x))"},
        {"shape": "step", "height": 2.576e-06, "at": 0.01745},
    ]
    empty = march(
        {
            "family": "bearing",
            "L": 0.0216,
            "U": 0.488,
            "n": 40,
            "fluid": {"mu": 0.078, "p_supply": 0.0},
            "film": film,
            "sides": {"west": "closed", "east": 0.0},
            "elastic": {"compliance": 6.287e-16},
            "asperity": {"sigma": 7.78e-07, "E_reduced": 1e8},
            "motion": {"t_end": 0.197, "steps": 2, "set": {"h_offset": "4.96e-07*(1-cos(135.4*t))"}},
        }
    )
    assert empty.cavitated_fraction == 1.0 and empty.mass_defect_run < 1e-4


def test_the_symmetric_half_is_the_whole():
    scene = WEDGE | SIDES["mirror"]
    half, whole = march(scene), solve(load_scene(scene), reduction=False)
    assert half.settings["details"]["reduction"] == "mirror"
    np.testing.assert_allclose(half.fields["p"], whole.fields["p"], rtol=0, atol=1e-9 * whole.fields["p"].max())
    whole.destroy()


def test_steps_as_long_as_their_error_allows():
    fine = march(WEDGE, **{"motion.steps": 200}).load
    found = []
    for tol in (3e-2, 5e-3):
        s = march(WEDGE | {"motion": {"t_end": 0.02, "tol": tol}})
        found.append((abs(s.load / fine - 1), len(s.history)))
        assert s.step_min < 0.5 * s.step_max and s.history[-1]["t"] == pytest.approx(0.02, rel=1e-12)
    (rough, few), (good, many) = found
    assert good < 1e-2 and good < 0.5 * rough and few < many < 200


def test_rates_that_jump_do_not_stop_the_march():
    """Pressures jump where a cell fills, however short the step; the march passes by with steps of tol t_end/100 or so."""
    film = {"shape": "formula", "h": "7e-6 + 2e-6*cos(400*x - 2100*t)"}
    scene = {"family": "bearing", "L": 0.02, "U": 3.0, "n": 15, "fluid": {"mu": 0.03, "p_supply": 1e5}, "film": film}
    s = march(scene | {"motion": {"t_end": 0.003, "tol": 1e-3}})
    assert s.step_min > 1e-6 * 0.003 and len(s.history) < 500 and "of the oil lost" in s.message
    assert s.load == pytest.approx(march(scene | {"motion": {"t_end": 0.003, "steps": 150}}).load, rel=2e-3)


def test_smooth_motion_takes_two_iterations_a_step_at_most():
    for scene, t_end in ((WEDGE | {"n": 200}, 0.005), ("moving_texture", 0.0025)):
        assert march(scene, **{"motion.steps": 50, "motion.t_end": t_end}).iterations_per_step <= 2
    assert march("squeeze").iterations_per_step <= 1.5


def test_a_step_begins_from_full_films_as_they_are():
    """DIN leaves r = 1e-30 in them, which tells nothing of where they will rupture."""
    fluid = {"mu": 0.12, "barus": 1.7e-8, "density": "dowson-higginson"}
    film = {"shape": "formula", "h": "1e-4 + 1.4e-5*(1-cos(51*t))"}
    pad = {"family": "bearing", "L": 0.08, "U": 0.7, "n": 3, "sides": {"west": 1.25e6}, "fluid": fluid, "film": film}
    own, exact = (march(pad | {"motion": {"t_end": 0.8, "steps": 5}}, method=m) for m in ("din", "active-set"))
    assert own.fields["p"] == pytest.approx(exact.fields["p"], rel=1e-4)


def test_a_step_that_points_beyond_the_laws_largest_pressure_begins_elsewhere():
    line = PLATES | {"L": 0.026, "U": 6.0, "n": 479, "film": {"shape": "journal", "c": 6.3e-5, "eccentricity": 0.84}}
    line |= {"fluid": {"mu": 0.008, "p_supply": 4e4, "barus": 1.8e-7, "density": "dowson-higginson"}, "p_unit": None}
    line |= {"sides": {"west": {"p": 0.0, "r": 0.17}, "east": 7e5}, "supply": [{"x": [0.0167, 0.02], "flow": 3.7e-5}]}
    march({name: it for name, it in line.items() if it is not None} | {"motion": {"t_end": 1.3e-3, "steps": 5, "fill": 0.63}})


def test_a_supply_foreseen_without_pressure_finds_one():
    source = {"x": [3.3e-3, 4.6e-3], "y": [3.2e-4, 1.75e-3], "restrictor": "orifice", "p_s": 4.4e5, "K": 1.8e-10}
    part = RING | {"L": 6.7e-3, "width": 6.3e-3, "U": -1.3, "nx": 17, "ny": 3, "fluid": {"mu": 8.2e-3, "p_supply": 4.5e4}}
    part |= {"film": {"shape": "journal", "c": 2.8e-5, "eccentricity": 0.1}, "supply": [source | {"backflow": True}]}
    part |= {"sides": {"west": 473.0, "east": 4517.0, "south": 2686.0, "north": 3.7e5}}
    part |= {"motion": {"t_end": 0.0165, "steps": 9, "set": {"h_offset": "8.5e-6*(1-cos(1141*t))"}}}
    own, exact = (march(part, method=m) for m in ("fas", "active-set"))
    assert own.quantities["supply_p"] == pytest.approx(exact.quantities["supply_p"], rel=1e-4)


def test_a_journal_moves_by_formulas_and_by_a_file(tmp_path):
    given = RING | {"motion": {"t_end": 0.01, "steps": 10, "journal": ["0.3*cos(600*t)", "0.3*sin(600*t)"]}}
    one = march(given)
    t = np.linspace(0, 0.01, 401)
    rows = np.column_stack([t, 0.3 * np.cos(600 * t), 0.3 * np.sin(600 * t)])
    np.savetxt(tmp_path / "path.csv", rows, delimiter=",", header="t,X,Y", comments="")
    two = march(RING | {"motion": {"t_end": 0.01, "steps": 10, "file": str(tmp_path / "path.csv")}})
    assert two.load == pytest.approx(one.load, rel=1e-5)
    assert one.journal == pytest.approx([0.3 * math.cos(6), 0.3 * math.sin(6)])
    assert one.history[-1]["journal_x"] == one.journal[0]


@pytest.mark.parametrize("round_", ["groove", "periodic"])
def test_the_family_journal_moves(round_):
    """As the same film in a scene of shapes does; at rest it stays at its steady answer."""
    motion = {"t_end": 0.02, "steps": 10, "journal": ["0.2*sin(100*t)-0.4", "0.1*sin(200*t)"]}
    small = {"nx": 24, "ny": 5, "round": round_, "p_side": 1e5}
    one = march("journal", **small, motion=motion)
    journal = load_scene("journal", small)
    shape = {"shape": "journal", "c": journal.turning.c, "eccentricity": journal.eccentricity}
    around = {"west": "periodic", "east": "periodic"} if round_ == "periodic" else {"west": 0.0, "east": 0.0}
    keys = {"L": journal.L, "U": journal.U, "width": journal.width, "fluid": {"mu": journal.mu, "p_supply": 1e5}}
    two = march(RING | keys | {"nx": 24, "film": shape, "sides": around, "motion": motion})
    assert one.load == pytest.approx(two.load, rel=1e-9) and one.journal == two.journal
    still, steady = march("journal", **small, motion={"t_end": 0.02, "steps": 4}), march("journal", **small)
    assert still.load == pytest.approx(steady.load, rel=1e-9)


def test_a_journal_moves_in_pads_that_are_held():
    """A journal at rest has the steady film; a free one comes to where the pads, held, carry it."""
    held = {"nx": 48, "ny": 5, "pivots_deg": [60.0, 180.0, 300.0], "tilts": [1e-4] * 3, "balance": None}
    steady = march("tilting_pad_journal", **held, eccentricity=0.3)
    still = march("tilting_pad_journal", **held, motion={"t_end": 0.01, "steps": 4, "journal": [0.3, 0.0]})
    assert still.load == pytest.approx(steady.load, rel=1e-9)
    free = {"t_end": 0.2, "tol": 3e-2, "free": True, "mass": 5.0, "load": [3000.0, 0.0]}
    assert march("tilting_pad_journal", **held, motion=free).force == pytest.approx([-3000.0, 0.0], abs=1.0)


def test_newton_steps_of_films_between_grooves_are_counted_side_by_side():
    """At most two a time step, on smooth motion of 40 steps a turn."""
    motion = {"t_end": 0.02, "steps": 40, "journal": ["0.5+0.1*cos(314.159*t)", "0.3+0.1*sin(314.159*t)"]}
    for name in ("two_groove_journal", "ring_journal"):
        assert march(name, nx=90, ny=7, motion=motion).iterations_per_step <= 2.0


def test_a_free_journal_comes_to_where_the_load_holds_it():
    """The limit of a static load is the static answer, in a ring and between grooves."""
    small = {"nx": 48, "ny": 5}
    balanced = solve(load_scene("two_groove_journal", **small, balance={"load": 1500.0}))
    e, phi = balanced.settings["balance"]["value"], math.radians(balanced.settings["attitude_deg"])
    balanced.destroy()
    motion = {"t_end": 0.4, "tol": 3e-2, "free": True, "mass": 5.0, "load": ["1500", "0"], "position": [0.3, 0.3]}
    s = march("two_groove_journal", **small, motion=motion)
    assert s.journal == pytest.approx([e * math.cos(phi), e * math.sin(phi)], abs=1e-5)


def test_an_orbit_is_of_second_order():
    """Places at one moment of the dynamically loaded journal, from steps that halve."""
    ends = []
    for steps in (8, 16, 32, 64):
        s = march("dynamic_journal", nx=16, ny=3, **{"motion.t_end": 0.002, "motion.steps": steps})
        ends.append(np.array(s.journal))
        assert s.mass_defect_run < 1e-10
    errors = [np.hypot(*(b - a)) for a, b in pairwise(ends)]
    assert errors[-1] < 1e-3 and errors[0] / errors[1] > 2.5 and errors[1] / errors[2] > 3


def history(path):
    return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(path.read_text().splitlines())]


# The command line in a process that sends itself a signal when it has taken some steps: no clock, no waiting.
SIGNALLED = """
import os, sys
from lcp_lube.drivers.marches.march_file import MarchFile
after = MarchFile.after
def then(self, run):
    if len(run.history) == {steps}:
        os.kill(os.getpid(), {signal})
    after(self, run)
MarchFile.after = then
from lcp_lube.__main__ import main
sys.exit(main())
"""


def signalled(tmp_path, steps, number, *words):
    program = SIGNALLED.format(steps=steps, signal=int(number))
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=300)


def test_a_march_is_taken_up_where_it_was_killed(cli, tmp_path):
    """kill -9: the history stands, and from the last checkpoint the run ends as if nothing had been."""
    small = {"motion.steps": 60, "n": 59}
    whole = march("moving_texture", **small)
    words = ["solve", "moving_texture", *(f"--set={key}={value}" for key, value in small.items())]
    options = [*words, "--history", "h.csv", "--checkpoint", "c", "--every", "3"]
    killed = signalled(tmp_path, 31, signal.SIGKILL, *options)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert len(history(tmp_path / "h.csv")) == 31
    again = cli(*options, "--resume", "c", "--json", timeout=300)
    assert again.status == 0, again.err
    for name in ("load", "p_max", "time_steps"):
        assert again.json[name] == pytest.approx(getattr(whole, name), rel=1e-9), name
    assert again.json["mass_defect_run"] < 1e-12
    rows = history(tmp_path / "h.csv")
    assert len(rows) == 60 and np.all(np.diff([row["t"] for row in rows]) > 0)


def test_an_orbit_is_taken_up(tmp_path):
    small = {"nx": 16, "ny": 3, "motion.t_end": 0.001, "motion.steps": 12}
    whole = march("dynamic_journal", **small)
    solution = taken_up(load_scene("dynamic_journal", small), tmp_path / "c", 8)
    assert [row["t"] for row in solution.history] == [row["t"] for row in whole.history]
    assert solution.journal == pytest.approx(whole.journal, rel=1e-13) and solution.load == pytest.approx(whole.load, rel=1e-12)
    assert [row["solves"] for row in solution.history] == [row["solves"] for row in whole.history]
    solution.destroy()


def test_told_to_end_a_march_saves_its_step(tmp_path):
    words = ["solve", "squeeze", "--set", "steps=4000", "--checkpoint", "c", "--every", "100000"]
    told = signalled(tmp_path, 6, signal.SIGINT, *words)
    assert "--resume c goes on" in told.stderr and told.returncode == 130
    with pytest.raises(InputError, match="another scene"):
        solve(load_scene("squeeze", {"steps": 4001}), resume=tmp_path / "c")


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks(cli, ranks):
    small = {"nx": 24, "ny": 6, "motion.steps": 4, "motion.t_end": 0.0008}
    words = [
        "solve",
        "dynamic_journal",
        *(f"--set={key}={value}" for key, value in small.items()),
        "--history",
        "h.csv",
        "--json",
    ]
    together = cli(*words, *(("--method", "fas") if ranks == 3 else ()), ranks=ranks, timeout=300)
    assert together.status == 0, together.err
    alone = march("dynamic_journal", **small)
    assert together.json["journal"] == pytest.approx(alone.journal, abs=1e-7)
    assert together.json["load"] == pytest.approx(alone.load, rel=1e-5)


def test_what_is_kept_of_a_march(cli, tmp_path):
    run = cli("solve", "moving_texture", "--set", "motion.steps=20", "--plot", "a.gif", "--output", "a.pvd", "--times", 4)
    assert run.status == 0 and "20 time steps" in run.out, run.err
    text = (tmp_path / "a.pvd").read_text()
    names = sorted(path.name for path in tmp_path.glob("*.vts"))
    assert len(names) == 4 and all(name in text for name in names) and 'timestep="0.0025"' in text
    Image = pytest.importorskip("PIL.Image")
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 4


def test_oil_that_flows_back_through_a_restrictor_is_refused_at_any_step():
    """At the last step it does not: the texture's crests have gone by."""
    supply = {"x_mm": [12, 14], "restrictor": "capillary", "K": 1e-11, "p_s": 3.2e6}
    dimples = {"shape": "dimples", "moves": True, "depth_um": 6.0, "size_mm": 2.0, "columns": 5, "form": "dome"}
    film = [{"shape": "linear", "h_start_um": 12, "h_end_um": 6.0}, dimples]
    scene = load_scene("moving_texture", {"n": 99, "film": film, "supply": [supply], "motion.steps": 20})
    with pytest.raises(InputError, match=r"t = 0.0005 s: supply.1.p_s = 3.2e\+06: less than the film's pressure there"):
        solve(scene)
    solve(scene, **{"supply.1.backflow": True}).destroy()


def test_bad_input(cli, tmp_path):
    ring = tmp_path / "ring.toml"
    text = """
        family = "bearing"
        dimension = 2
        L = 0.3
        width = 0.1
        U = 10.0
        nx = 24
        ny = 5
        fluid = {mu = 0.02, p_supply = 1e5}
        film = {shape = "journal", c = 1e-4, eccentricity = 0.5}
        sides = {west = "periodic", east = "periodic"}
        [motion]
        t_end = 0.1
        steps = 20"""
    ring.write_text(text + '\njournal = ["18*t", "0"]\n')
    run = cli("solve", "ring.toml", "--history", "h.csv")
    assert run.status == 2 and "t = 0.06 s: film -8e-06 m at x = 0, y =" in run.lines[-1] and len(run.lines) == 1, run.err
    assert len(history(tmp_path / "h.csv")) == 11
    for words, message in (
        (("problem1", "--history", "h.csv"), "does not go on in time"),
        (("problem1", "--plot", "a.gif"), "does not go on in time"),
        (("squeeze", "--times", "0.1,9"), "--times 0.1,9"),
    ):
        run = cli("solve", *words)
        assert run.status == 2 and message in run.lines[-1] and len(run.lines) == 1, (words, run.err)


@pytest.mark.parametrize(
    "scene, changes, message",
    [
        ("moving_texture", {"motion.dt": 1.0}, "steps and dt are both given"),
        ("moving_texture", {"motion.free": True}, "load is missing"),
        ("moving_texture", {"motion.journal": ["t", "0"]}, "the shape 'journal'"),
        ("moving_texture", {"balance.load": 3.0}, "balance and motion"),
        ("dynamic_journal", {"motion.load": ["log(0-1)", "0"]}, "no number at t ="),
        ("pocketed_pad", {"film.pocket.moves": True}, r"a table \[motion\] is needed"),
        ("journal", {"motion.t_end": 1.0, "balance.load": 3.0}, "balance and motion"),
        ("journal", {"motion.t_end": 1.0, "graded": True}, "graded = true"),
    ],
)
def test_scenes_that_cannot_move(scene, changes, message):
    with pytest.raises(InputError, match=message):
        solve(load_scene(scene, changes))


def test_a_step_that_is_too_large_is_said_to_be():
    with pytest.raises(InputError, match=r"t = .* the content at x = .* is negative"):
        solve(load_scene("squeeze", {"h_amplitude": 0.374, "steps": 4, "t_end": 0.5}))
