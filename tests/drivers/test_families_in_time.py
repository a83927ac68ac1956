"""[motion] in every family of films: numbers that follow formulas, walls with texture, levels and pads that are free."""

import math

import numpy as np
import pytest
from marches import WEDGE, taken_up
from test_motion import march

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients

PADS = {"nx": 60, "ny": 5, "pivots_deg": [60.0, 180.0, 300.0], "balance": None}  # three: their cost is by pads, not by points
WAYS = {
    "slider": ("problem1", {"n": 60, "motion.set.h_offset": "3e-6*sin(300*t)"}),
    "wave on the wall": ("problem1", {"n": 60, "moves": True}),
    "rough": ("rough", {"n": 24, "moves": True}),
    "textured": ("textured_slider", {"n": 40, "moves": True}),
    "start-up": ("problem4", {"n": 24, "motion.set.U": "5*(1-exp(-300*t))", "motion.start": "full"}),
    "sector": ("tapered_land", {"nx": 30, "ny": 12, "motion.set.h_min": "2.5e-5+3e-6*sin(300*t)"}),
    "tilting sector": ("tilting_pad_thrust", {"nx": 24, "ny": 12, "motion.set.h_offset": "5e-6*sin(300*t)"}),
    "misaligned": ("misaligned_journal", {"nx": 48, "ny": 7, "motion.set.tilt": "2e-4*sin(300*t)", "attitude_deg": 40.0}),
    "grooves on the journal": ("two_groove_journal", {"nx": 48, "ny": 7, "attitude_deg": 40.0, "film": [
        {"shape": "dimples", "depth_um": 20, "size_mm": 5, "columns": 7, "rows": 3, "form": "dome", "moves": True}]}),
    "pads": ("tilting_pad_journal", PADS | {"motion.journal": ["0.3+0.1*sin(300*t)", "0.1*cos(300*t)-0.1"]}),
    "pads with inertia": ("tilting_pad_journal", PADS | {"motion.set.p_groove": "1e5*sin(300*t)^2",
                                                "motion.pad_inertia": 1e-4}),
    "to smaller x": (WEDGE | {"U": -1.0, "supply": [{"x_mm": [4, 5], "p": 2e6}], "n": 40},
                     {"motion.set.U": "0.5*sin(300*t)-1"}),
}  # fmt: skip


@pytest.mark.parametrize("name", WAYS)
def test_nothing_is_lost(name):
    scene, changes = WAYS[name]
    s = march(scene, **{"balance": None, **changes, "motion.t_end": 0.02, "motion.steps": 12})
    assert s.mass_defect <= 1e-10 and s.mass_defect_run <= 1e-10
    assert np.ptp([row["load"] for row in s.history]) > 1e-4 * abs(s.load)


@pytest.mark.parametrize("name", ["slider", "sector", "tilting sector", "pads"])
def test_at_rest_it_is_the_steady_film(name):
    scene, changes = WAYS[name]
    still = {key: value for key, value in changes.items() if not key.startswith("motion")} | {"balance": None}
    s = march(scene, **still, **{"motion.t_end": 0.01, "motion.steps": 3})
    assert s.load == pytest.approx(march(scene, **still).load, rel=1e-8)


@pytest.mark.parametrize("name", ["sector", "tilting sector", "pads"])
def test_second_order(name):
    scene, changes = WAYS[name]
    ends = [
        march(scene, **changes | {"balance": None}, **{"motion.t_end": 0.004, "motion.steps": steps}).load
        for steps in (3, 6, 18)
    ]
    errors = np.abs(np.array(ends[:-1]) - ends[-1])
    assert np.log2(errors[0] / errors[1]) > 1.7 and errors[1] < 1e-2 * abs(ends[-1])


def test_a_table_a_formula_and_a_shape_say_the_same(tmp_path):
    moved = "3e-6*sin(300*t)"
    t = np.linspace(0, 0.011, 300)
    np.savetxt(tmp_path / "level.csv", np.column_stack([t, 3e-6 * np.sin(300 * t)]), delimiter=",")
    film = [{"shape": "linear", "h_start_um": 40, "h_end_um": 20}]
    plain = {"family": "bearing", "L": 0.1, "U": 5.0, "n": 40, "fluid": {"mu": 0.02}, "film": film}
    motion = {"t_end": 0.01, "steps": 10}
    one = march(plain | {"motion": motion | {"set": {"h_offset": moved}}})
    two = march(plain | {"motion": motion | {"file": str(tmp_path / "level.csv")}})
    three = march(plain | {"film": [*film, {"shape": "formula", "h": moved}], "motion": motion})
    assert one.load == pytest.approx(three.load, rel=1e-9) and two.load == pytest.approx(three.load, rel=1e-5)
    assert two.h_offset == pytest.approx(3e-6 * math.sin(3.0), rel=1e-4)


def test_a_wall_whose_speed_changes_carries_its_texture_as_far():
    """U t of a constant speed, 5 t/2 of one that grows from 0 to 5 m/s: the texture stands where it does at 2.5 m/s."""
    small = {"n": 40, "moves": True, "motion.t_end": 0.01, "motion.steps": 4}
    constant = march("textured_slider", **small)
    assert march("textured_slider", **small, **{"motion.set.U": str(constant.problem.U)}).load == pytest.approx(constant.load)
    grows, half = (
        load_scene("textured_slider", small, **{"U": 2.5, **more}).models()(0.01, None).gap
        for more in ({"motion.set.U": "500*t"}, {})
    )
    x, y = np.meshgrid(np.linspace(0, 0.08, 50), np.linspace(0, 0.08, 7))
    np.testing.assert_allclose(grows(x, y), half(x, y))


@pytest.mark.parametrize("name, mass", [("problem1", 1.0), ("tapered_land", 20.0)])
def test_a_free_level_comes_to_where_the_load_is_carried(name, mass):
    small = {"n": 40} if name == "problem1" else {"nx": 30, "ny": 12}
    load = 1.2 * march(name, **small, balance=None).load
    balanced = solve(load_scene(name, small | {"balance": {"load": load, "vary": "h_offset"}}))
    motion = {"t_end": 2.0, "tol": 3e-2, "free": True, "load": load, "mass": mass}
    s = march(name, **small, balance=None, motion=motion)
    assert s.h_offset == pytest.approx(balanced.settings["balance"]["value"], rel=1e-4) and s.load == pytest.approx(
        load, rel=1e-6
    )
    balanced.destroy()


@pytest.mark.parametrize("name, load", [("tilting_pad_journal", [3000.0, 0.0]), ("tilting_pad_thrust", 10000.0)])
def test_a_free_bearing_comes_to_the_place_of_its_balance(name, load):
    small = {"nx": 48, "ny": 5} if name == "tilting_pad_journal" else {"nx": 24, "ny": 12}
    balanced = solve(load_scene(name, small | {"balance": {"load": np.max(load)}}))
    found = balanced.settings["coordinates"]
    motion = {"t_end": 0.2, "tol": 3e-2, "free": True, "load": load, "mass": 5.0}
    s = march(name, **small, balance=None, motion=motion)
    tilts = found[2:] if name == "tilting_pad_journal" else found[1:]
    assert s.pad_tilts == pytest.approx(tilts, rel=1e-5)
    balanced.destroy()


def test_pads_answer_small_motions_as_their_coefficients_say():
    """Journal moved by 1e-4 of its clearance at nu = omega: the force is that of K + i nu C with pads that follow."""
    scene = load_scene("tilting_pad_journal", PADS | {"eccentricity": 0.3})
    nu, c, a = scene.omega, scene.clearance, 1e-4
    steady = solve(scene)
    Z = next(iter(coefficients(scene, steady, [nu])))
    x = load_scene(scene, {"motion": {"t_end": 3 * math.pi / nu, "steps": 60, "journal": [f"0.3+{a}*sin({nu}*t)", "0"]}})
    with solve(x) as s:
        rows = s.history[20:]  # the last turn: pads have forgotten the start after half of one
    steady.destroy()
    t, force = np.array([row["t"] for row in rows]), np.array([row["force_x"] for row in rows])
    in_phase, across = (2 * np.mean(force * wave(nu * t)) / (a * c) for wave in (np.sin, np.cos))
    assert in_phase == pytest.approx(-Z.K[0, 0], rel=5e-3) and across == pytest.approx(-nu * Z.C[0, 0], rel=2e-2)


@pytest.mark.parametrize("name", ["grooves on the journal", "to smaller x", "tilting sector"])
def test_a_march_is_taken_up_whatever_solves_its_steps(name, tmp_path):
    data, changes = WAYS[name]
    scene = load_scene(data, {"balance": None, **changes, "motion.t_end": 0.004, "motion.steps": 4})
    whole, short = march(scene), load_scene(scene, {"motion.t_end": 0.002, "motion.steps": 2})
    solve(short, checkpoint=tmp_path / "c", every=1).destroy()
    with pytest.raises(InputError, match="another scene"):  # of steps of another number
        solve(scene, resume=tmp_path / "c")
    halves = {"motion.steps": None, "motion.dt": 0.001}
    solve(load_scene(short, halves), checkpoint=tmp_path / "d", every=1).destroy()
    with solve(load_scene(scene, halves), resume=tmp_path / "d") as s:
        assert len(s.history) == 4 and s.load == pytest.approx(whole.load, rel=1e-7)


def test_pads_are_taken_up_and_march_on_ranks(cli, tmp_path):
    motion = {"motion.t_end": 0.002, "motion.steps": 4, "motion.journal": ["0.3+0.1*sin(300*t)", "0.1*cos(300*t)-0.1"]}
    scene = load_scene("tilting_pad_journal", PADS | motion)
    whole = march(scene)
    with taken_up(scene, tmp_path / "c", 3) as s:
        assert len(s.history) == 4 and s.pad_tilts == pytest.approx(whole.pad_tilts, rel=1e-7)
    alone = [whole.history[1][f"tilt_{pad}"] for pad in (1, 2, 3)]
    words = ("nx=60", "ny=5", "pivots_deg=[60,180,300]", "balance=none", "motion.t_end=0.001", "motion.steps=2")
    words += ('motion.journal=["0.3+0.1*sin(300*t)", "0.1*cos(300*t)-0.1"]',)
    words = ("solve", "tilting_pad_journal", *(f"--set={word}" for word in words), "--history", "h.csv", "--json")
    run = cli(*words, ranks=3, timeout=300)
    assert run.status == 0 and run.json["pad_tilts"] == pytest.approx(alone, rel=1e-7), run.err
    assert (tmp_path / "h.csv").read_text().startswith("t,dt,journal_x,journal_y,tilt_1,tilt_2,tilt_3,load")


@pytest.mark.parametrize(
    "scene, changes, message",
    [
        ("problem1", {"moves": True}, r"a table \[motion\] is needed"),
        ("problem1", {"motion.t_end": 1.0, "motion.journal": ["0", "0"]}, "there is no journal"),
        ("problem1", {"motion.t_end": 1.0, "motion.pad_inertia": 1.0}, "no pads follow"),
        ("problem1", {"motion.t_end": 1.0, "motion.free": True, "motion.load": [1.0, 0.0], "motion.mass": 1.0}, "one number"),
        ("two_groove_journal", {"motion.t_end": 1.0, "motion.free": True, "motion.load": 1.0, "motion.mass": 1.0}, "X, Y"),
        ("problem1", {"motion.t_end": 1.0, "motion.file": "a.csv", "motion.set.h_offset": "t"}, "both given"),
        ("problem1", {"motion.t_end": 1.0, "motion.set.L": "0.1+t"}, "extent"),
        ("problem1", {"motion.t_end": 1.0, "motion.set.h_mim": "1e-5"}, "h_mim"),
        ("problem1", {"motion.t_end": 1.0, "motion.set.mu": "0.1-t"}, r"mu = .*motion.set at t = 0.37 s"),
        ("problem1", {"motion.t_end": 1.0, "motion.set.mu": "x"}, "x is not known"),
        ("problem1", {"motion.t_end": 1.0, "motion.steps": 20, "motion.set.h_offset": "-1e-4*t"}, "t = 0.15 s: film"),
    ],
)
def test_bad_input(scene, changes, message):
    with pytest.raises(InputError, match=message):
        solve(load_scene(scene, {"balance": None, **changes} if scene != "problem1" else changes))
