"""Films of the third generator that once failed; the script itself runs any number of others, on any number of ranks."""

import pytest
from wilder_films import fault, judge

ONCE_FAILED = [
    (7, "a supply that gives nothing", "converged"),
    (31, "a supply that fills a ring: what it gives is nothing but rounding", "converged"),
    (51, "a flow that has no way out", "refused"),
    (71, "a supply that gives nothing, in a deep recess", "converged"),
    (178, "a supply of 1e-8 of what the sides drive through it", "converged"),
    (2000066, "a supply that gives nothing, in a recess beside a closed side", "converged"),
    (414, "an orifice that gives 1e-8 of what the film asks", "converged"),
]


@pytest.mark.parametrize("seed, why, what", ONCE_FAILED)
def test_films_that_once_failed(seed, why, what):
    verdict = judge(seed)
    assert verdict.what == what and not fault(verdict, {}), verdict
