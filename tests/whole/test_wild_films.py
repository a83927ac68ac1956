"""Films that nobody tuned for, new ones in every run: `auto` solves them, or refuses them with a reason, and is never wrong."""

import os
import secrets

import numpy as np
import pytest
from wild_films import judge, scene_of

from lcp_lube.api import solve

COUNT = 500


def test_films_that_nobody_tuned_for(tmp_path, capsys):
    """WILD_SEED=N takes the films of an earlier run."""
    first = int(os.environ.get("WILD_SEED", secrets.randbelow(10**9)))
    with capsys.disabled():
        print(f"\nwild films from WILD_SEED={first}")
    verdicts = [judge(seed, tmp_path) for seed in range(first, first + COUNT)]
    assert not [verdict for verdict in verdicts if not verdict.good]
    kinds = {verdict.what for verdict in verdicts}
    assert {"refused", "converged"} <= kinds
    assert np.mean([verdict.what == "converged" for verdict in verdicts]) > 0.6


CERTIFIED_WRONG_ONCE = [
    (30814, "thin parts beside a wall that drags all"),
    (30880, "no pressure but rounding's"),
    (902845, "a pocket behind a film of 1e-15 of its conductance"),
    (5017662, "half way up a steep wall between two pressures"),
    (5018091, "a dimple of 1e16 times its surroundings' conductance"),
    (771555, "pressures that drive 1e-9 of what the wall does"),
    (6017562, "a ring at 4e8 m/s, whose signs hang on pressures of 1e-9 of the largest"),
]


@pytest.mark.parametrize("seed, why", CERTIFIED_WRONG_ONCE)
@pytest.mark.parametrize("method", ["active-set", "din", "din-pc", "monotone", "fas", "pivoting"])
def test_films_with_answers_that_the_certificate_once_let_pass(seed, why, method, tmp_path):
    """No method alone calls a wrong answer converged."""
    assert not judge(seed, tmp_path, method=method, rescue=False).wrong


ONCE_FAILED = [
    (368, "nearest profile, U < 0"),
    (681, "at rest"),
    (665, "a ring next to empty"),
    (904489, "sqrt(x), U < 0"),
    (903736, "a ring with no pressure but rounding's"),
    (5000882, "a ring, 3 Pa where the wall could make 1e14"),
    (5010015, "a ring, one full cell"),
    (5010571, "cycles, conductances of 3e11"),
    (5016902, "conductances of 3e14"),
    (5000819, "pressures of 1e-199"),
    (880676270, "lines on edges round a ring: one face, seen from both ends"),
    (6017007, "round dimples that no point lies in"),
    (6008241, "no pressure, noise of 1e-40 as a start"),
    (6004666, "empty all over"),
    (6015374, "empty all over, a ring's misfit of one rounding"),
    (8013844, "a ring at 6e7 m/s and 5e-3 Pa, whose signs settle after 200 steps"),
    (8012352, "a wall at rest, conductances of 1e15"),
    (8014881, "round dimples that no point lies in, one side open"),
    (8018035, "a dead end at 1e7 m/s, empty but for rounding"),
    (1032, "a ring, half a cell before x = 0, where sqrt(x) is none"),
    *CERTIFIED_WRONG_ONCE,
]


@pytest.mark.parametrize("seed, why", ONCE_FAILED)
def test_films_that_once_failed(seed, why, tmp_path):
    verdict = judge(seed, tmp_path)
    assert verdict.good and verdict.what == "converged", verdict


@pytest.mark.parametrize("seed", [8013643, 43002079])
def test_films_beyond_all_methods_say_so(seed, tmp_path):
    """Rings with a seam 1e3 to 1e4 times as thick on its one side, closed on a side: one film of 10,000 drawn ones or fewer."""
    verdict = judge(seed, tmp_path)
    assert not verdict.wrong and verdict.what in ("converged", "max_iterations", "stalled", "linear_solver"), verdict


@pytest.mark.parametrize("seed", [665, 5010571])
def test_active_set_says_early_that_it_cycles(seed, tmp_path):
    solution = solve(scene_of(seed, tmp_path), method="active-set", rescue=False)
    assert solution.outcome == "stalled" and "in vain" in solution.message
    assert len(solution.steps) < 80
