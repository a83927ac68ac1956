"""Films that nobody tuned for, new ones in every run: `auto` solves them, or refuses them with a reason, and is never wrong."""

import os
import secrets

import numpy as np
import pytest
from wild_films import judge

COUNT = 300
# Among films of 5,000 seeds one or two end uncertified: pressures that are rounding of what the wall drags through a ring.
# More than two among 300 are then as good as impossible.
UNCERTIFIED = 2


def test_films_that_nobody_tuned_for(tmp_path, capsys):
    """WILD_SEED=N takes the films of an earlier run."""
    first = int(os.environ.get("WILD_SEED", secrets.randbelow(10**9)))
    with capsys.disabled():
        print(f"\nwild films from WILD_SEED={first}")
    verdicts = [judge(seed, tmp_path) for seed in range(first, first + COUNT)]
    wrong = [verdict for verdict in verdicts if verdict.wrong]
    assert not wrong
    uncertified = [verdict for verdict in verdicts if not verdict.good]
    assert len(uncertified) <= UNCERTIFIED, uncertified
    kinds = {verdict.what for verdict in verdicts}
    assert {"refused", "converged"} <= kinds
    assert np.mean([verdict.what == "converged" for verdict in verdicts]) > 0.6


CERTIFIED_WRONG_ONCE = [
    (30814, "thin parts beside a wall that drags all"),
    (30880, "no pressure but rounding's"),
    (902845, "a pocket behind a film of 1e-15 of its conductance"),
]


@pytest.mark.parametrize("seed, why", CERTIFIED_WRONG_ONCE)
@pytest.mark.parametrize("method", ["active-set", "din-pc", "monotone", "fas"])
def test_films_with_answers_that_the_certificate_once_let_pass(seed, why, method, tmp_path):
    """No method alone calls a wrong answer converged, but for one."""
    if (seed, method) == (902845, "din-pc"):
        pytest.xfail("open: an interior method's answer, wrong by 6 % in such a pocket, whose misfit is rounding in every cell")
    assert not judge(seed, tmp_path, method=method, rescue=False).wrong


ONCE_FAILED = [
    (368, "nearest profile, U < 0"),
    (681, "at rest"),
    (665, "a ring next to empty"),
    (904489, "sqrt(x), U < 0"),
    *CERTIFIED_WRONG_ONCE,
]


@pytest.mark.parametrize("seed, why", ONCE_FAILED)
def test_films_that_once_failed(seed, why, tmp_path):
    verdict = judge(seed, tmp_path)
    assert verdict.good and verdict.what == "converged", verdict
