"""Films that nobody tuned for, new ones in every run: `auto` solves them, or refuses them with a reason, and is never wrong."""

import os
import secrets

import numpy as np
import pytest
from wild_films import judge

COUNT = 500


def test_films_that_nobody_tuned_for(tmp_path, capsys):
    """WILD_SEED=N takes the films of an earlier run."""
    first = int(os.environ.get("WILD_SEED", secrets.randbelow(10**9)))
    with capsys.disabled():
        print(f"\nwild films from WILD_SEED={first}")
    verdicts = [judge(seed, tmp_path) for seed in range(first, first + COUNT)]
    bad = [verdict for verdict in verdicts if not verdict.good]
    # About one in a thousand is still open: an active set that cycles at rounding, and what takes over.
    assert len(bad) <= 4, f"{len(bad)} of {COUNT}: {bad}"
    kinds = {verdict.what for verdict in verdicts}
    assert {"refused", "converged"} <= kinds
    assert np.mean([verdict.what == "converged" for verdict in verdicts]) > 0.6


@pytest.mark.parametrize("seed, why", [(368, "nearest profile, U < 0"), (681, "at rest"), (665, "a ring next to empty")])
def test_films_that_once_failed(seed, why, tmp_path):
    verdict = judge(seed, tmp_path)
    assert verdict.good and verdict.what == "converged", verdict
