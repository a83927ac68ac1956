"""60 solves of every method, half of them with `destroy` and half without: what PETSc holds is freed either way."""

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lcp_lube import Complementarity, solve
from lcp_lube.registry import METHODS

SOLVES = 60
WARM = 20  # before memory is measured: caches fill, compiled code is loaded
LEAK = 1.5e6  # bytes: without finalisers 30 dropped solutions hold more, also of fas, which has no matrix

SCENES: dict[str, dict[str, Any]] = {
    "lubrication": {"scene": "problem4", "n": 36},
    "box": {"scene": "obstacle_bratu", "n": 36},
    "equations": {"scene": "bratu", "n": 36},
    "mixed": {"scene": "ehl_line", "n": 40},
}


def user() -> Complementarity:
    n = 100
    A = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return Complementarity(lambda v: A @ v - 1.0, lambda v: A, lower=np.zeros(n), upper=np.full(n, 5.0), x0=np.zeros(n))


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def growth(run: Callable[[], Any]) -> int:
    """Bytes that the solves leave behind."""

    def many(count: int) -> None:
        for k in range(count):
            solution = run()
            if k % 2:
                solution.destroy()
                solution.destroy()

    many(WARM)
    gc.collect()
    before = resident()
    many(SOLVES)
    gc.collect()
    return resident() - before


CASES = [(name, kind) for name in METHODS for kind in SCENES if kind in METHODS[name].kinds]


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("name, kind", CASES, ids=lambda word: word)
def test_no_leak(name: str, kind: str) -> None:
    how = {**SCENES[kind], "method": name, "stopping": {"max_it": 2}, "rescue": False}
    assert growth(lambda: solve(**how)) < LEAK


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("system", ["full", "cavity"])
def test_no_leak_of_a_system(system: str) -> None:
    assert growth(lambda: solve("problem4", n=36, method="active-set", system=system)) < LEAK


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_no_leak_of_a_users_problem() -> None:
    assert growth(lambda: solve(user(), method="semismooth")) < LEAK
