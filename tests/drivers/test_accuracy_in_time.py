"""Marches to an accuracy: grid and steps in proportion, errors of both, relative to what came and went; and free places."""

import csv

import numpy as np
import pytest
from marches import WEDGE

from lcp_lube import load_scene, solve
from lcp_lube.drivers.accuracy.estimate import Traits
from lcp_lube.drivers.accuracy.values import Values
from lcp_lube.drivers.marches import rotor
from lcp_lube.errors import InputError

SMALL = {"nx": 24, "ny": 3, "motion.steps": 42, "motion.t_end": 0.014}  # of `dynamic_journal`: till after its two pulses


@pytest.mark.parametrize(
    "given, finer, coarser",
    [
        ({"steps": 20}, {"steps": 40}, {"steps": 10}),
        ({"dt": 1e-3}, {"steps": 40, "dt": None}, {"steps": 10, "dt": None}),
        ({"tol": 4e-3}, {"tol": 1e-3}, {"tol": 1.6e-2}),
        ({"tol": 4e-3, "scheme": "euler"}, {"tol": 2e-3}, {"tol": 8e-3}),
        ({}, {"tol": 2.5e-4}, {"tol": 4e-3}),
    ],
    ids=str,
)
def test_steps_go_with_the_grid(given, finer, coarser):
    scene = load_scene({**WEDGE, "n": 31, "motion": {"t_end": 0.02, **given}})
    for n, expected in ((63, finer), (15, coarser), (31, given)):
        motion = scene.refined((n,)).motion
        assert {key: getattr(motion, key) for key in expected} == pytest.approx(expected)
    plane = load_scene({**WEDGE, "dimension": 2, "width_mm": 5, "nx": 31, "ny": 15, "motion": {"t_end": 0.02, "steps": 20}})
    assert plane.refined((63, 31)).motion.steps == 40
    assert plane.with_shape((63, 31)).motion.steps == 20
    assert plane.refined((63, 15)).motion.steps == 28  # 2^(1/2) of 20


def test_no_tolerance_leaves_its_range():
    motion = load_scene({**WEDGE, "motion": {"t_end": 0.02, "tol": 1e-2}}).motion
    assert 1e-9 < motion.finer(1e9).tol < motion.finer(1e-9).tol < 1


@pytest.mark.parametrize("scheme, tol", [("bdf2", 4e-3), ("euler", 2e-2)])
def test_the_estimate_is_of_grid_and_steps(scheme, tol):
    """On a grid that leaves nothing to be wished the steps that the scene gives err more than the estimate."""
    made = {**WEDGE, "n": 60, "motion": {"t_end": 0.016, "steps": 24, "scheme": scheme}}
    fine, long = ({**made, "n": 241, "motion": {**made["motion"], "steps": steps}} for steps in (384, 24))
    truth, coarse = (solve(load_scene(scene)) for scene in (fine, long))
    found = solve(load_scene(made), accuracy=tol)
    largest = max(row["load"] for row in truth.history)
    assert found.converged
    assert len(found.history) > 24
    assert found.solved_scene.motion.steps == len(found.history)
    assert abs(found.load - truth.load) <= found.settings["accuracy_estimate"] * largest <= tol * largest
    assert abs(coarse.load - truth.load) > tol * largest
    error = found.estimates["load"]["error"]
    assert error == pytest.approx(found.settings["accuracy_estimate"] * max(row["load"] for row in found.history))


def test_a_load_that_has_gone_is_measured_by_the_largest():
    """Between two pulses little is left: to a part of that no grid would do."""
    found = solve(load_scene("dynamic_journal", SMALL), accuracy=5e-2)
    largest = max(row["load"] for row in found.history)
    assert found.converged
    assert len(found.levels) == 3
    assert abs(found.load) < 1e-2 * largest
    assert found.estimates["load"]["error"] <= 5e-2 * largest


def test_no_load_that_is_nowhere_below_nothing_is_extrapolated_to_less():
    told = Values(Traits(), 0.0)
    told._sizes, told._misplaced = [1.0, 2.0**0.5, 2.0], [0.0] * 3
    assert told._best("load", [30.0, 20.0, 5.0]).value == 0.0
    assert told._best("load", [30.0, -20.0, 5.0]).value > 5.0
    assert told._best("moment", [30.0, 20.0, 5.0]).value < 0.0


def test_a_load_may_end_as_nothing():
    """The wall comes nearer and lifts off, and all pressure is gone: nothing beside what there was."""
    lifted = [{"shape": "linear", "h_start_um": 4, "h_end_um": 2}, {"shape": "formula", "unit": "um", "h": "-sin(600*t)"}]
    scene = {**WEDGE, "fluid": {"mu": 0.01, "p_supply": 0.0}, "film": lifted, "motion": {"t_end": 0.0075, "steps": 30}}
    found = solve(load_scene({**scene, "U": 0.01}), accuracy=1e-2)
    assert found.converged, found.message
    assert found.load == 0.0
    assert max(row["load"] for row in found.history) > 1.0


def test_digits_spare_solves_and_no_more():
    exact, loose = (solve(load_scene("dynamic_journal", SMALL), digits=digits) for digits in (0.0, 1e-5))
    assert loose.settings["details"]["solves_per_step"] < 0.85 * exact.settings["details"]["solves_per_step"]
    places = [np.array([[row["journal_x"], row["journal_y"]] for row in one.history]) for one in (exact, loose)]
    assert 0.0 < np.abs(places[1] - places[0]).max() < 1e-4


def test_a_wall_that_would_touch_is_gone_towards():
    """Half of the way, a quarter, and where there is none the film before."""
    seen = []

    def there_is_room(to):
        def film_at(q):
            seen.append(float(q[0]))
            if q[0] > to:
                raise InputError("the wall touches")
            return "film"

        return film_at

    for room, expected in ((10.0, [8.0]), (5.0, [8.0, 4.0]), (2.0, [8.0, 4.0, 2.0]), (0.5, [8.0, 4.0, 2.0, 0.0])):
        seen.clear()
        film, place = rotor._film_towards(np.array([8.0]), np.array([0.0]), there_is_room(room))
        assert (film, seen, float(place[0])) == ("film", expected, expected[-1])
    with pytest.raises(InputError, match="touches"):
        rotor._film_towards(np.array([8.0]), np.array([0.0]), there_is_room(-1.0))


def test_equal_steps_have_one_matrix():
    """Times are rounded, and a formula's weight with them: what is known of the forces stays."""
    made = []
    keep = rotor.Rotor.settle

    def settle(self, t, formula, start, film_at, stiffness):
        def counted(solution):
            made.append(t)
            return stiffness(solution)

        return keep(self, t, formula, start, film_at, counted)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rotor.Rotor, "settle", settle)
        quiet = {**SMALL, "motion.load": ["500.0", "0.0"], "motion.steps": 200}
        solution = solve(load_scene("dynamic_journal", quiet))
    assert solution.converged
    assert len(made) < 0.2 * len(solution.history)


@pytest.mark.parametrize("ranks, picture", [(1, "run.gif"), (2, "run.png")])
def test_what_is_kept_is_of_the_last_grid(cli, tmp_path, ranks, picture):
    """History, fields and pictures: of the march that is the answer, and nothing of those before it."""
    few = [f"--set={word}" for word in ("n=24", "motion.steps=8", "film.2.columns=2")]
    words = ["solve", "moving_texture", *few, "--accuracy", "1e-3", "--n", "99", "--history", "h.csv", "--json"]
    run = cli(*words, "--output", "run.pvd", "--times", "4", "--plot", picture, ranks=ranks)
    assert len(run.json["levels"]) == 3, run.err
    steps = run.json["time_steps"]
    rows = list(csv.DictReader((tmp_path / "h.csv").read_text().splitlines()))
    assert len(rows) == steps
    assert np.all(np.diff([float(row["t"]) for row in rows]) > 0)
    listed = (tmp_path / "run.pvd").read_text()
    files = {path.name for path in tmp_path.glob("run_*.vts")}
    assert len(files) == 4
    assert all(name in listed for name in files)
    assert f"run_{steps:06d}.vts" in files
    assert (tmp_path / picture).stat().st_size > 0
