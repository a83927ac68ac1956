"""Films of the third generator that once failed; the script itself runs any number of others, on any number of ranks."""

import pytest
from wilder_films import fault, judge, way_of

ONCE_FAILED = [
    (7, "a supply that gives nothing", "converged"),
    (31, "a supply that fills a ring: what it gives is nothing but rounding", "converged"),
    (51, "a flow that has no way out", "refused"),
    (71, "a supply that gives nothing, in a deep recess", "converged"),
    (178, "a supply of 1e-8 of what the sides drive through it", "converged"),
    (2000066, "a supply that gives nothing, in a recess beside a closed side", "converged"),
    (414, "an orifice that gives 1e-8 of what the film asks", "converged"),
    (2000245, "the edge of a supply across a periodic side", "converged"),
    (9000995, "the same, all sides periodic", "converged"),
    (76, "an orifice through which 1e-10 of the flow goes, back", "converged"),
    (9003048, "an orifice whose root is still far when its pressure hardly moves", "converged"),
    (9001329, "one point, held, between closed sides", "refused"),
    (9007127, "an orifice, from too low to too high a pressure and back", "converged"),
    (9008285, "no way out but back through the one restrictor", "converged"),
]


@pytest.mark.parametrize("seed, why, what", ONCE_FAILED)
def test_films_that_once_failed(seed, why, what):
    verdict = judge(seed)
    assert verdict.what == what and not fault(verdict, {}), verdict


@pytest.mark.parametrize("seed", [9002734, 9002797, 9007116])
def test_named_methods_alone_that_once_failed(seed):
    """Products below 1e-308, p = 8e-5 Pa where it is 0, a wall that drags so much that the film hears nothing of a pressure."""
    assert not fault(judge(seed, **way_of(seed)), way_of(seed))
