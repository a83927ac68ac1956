"""Threads in the loops over large films: the bits are those of one thread, and small films start none."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from lcp_lube import solve
from lcp_lube.base import crew
from lcp_lube.errors import InputError
from lcp_lube.solvers import fas

FILMS = [
    ("problem4", {"nx": 350, "ny": 352}),
    ("dimpled_pad", {"nx": 399, "ny": 311}),  # rims, deep jumps
    ("pocketed_pad_2d", {"nx": 400, "ny": 310}),
    ("journal", {"nx": 400, "ny": 311}),  # closed by a groove
    ("ring_journal", {"nx": 400, "ny": 311}),  # lines that are closed: swept by one thread
]


@pytest.mark.parametrize(("name", "grid"), FILMS)
def test_the_same_bits_on_any_number_of_threads(name, grid, monkeypatch):
    """Of the fields, of the record of all cycles, and of every number that is read off."""
    found = []
    for threads in ("1", "2", "3"):
        monkeypatch.setenv(crew.VARIABLE, threads)
        with solve(name, method="fas", **grid) as solution:
            assert solution.converged
            assert crew.crew().threads == int(threads)
            found.append((solution.fields, solution.steps, repr(solution.numbers)))
    for fields, steps, numbers in found[1:]:
        assert all(np.array_equal(fields[field], found[0][0][field]) for field in fields)
        assert (steps, numbers) == found[0][1:]


def test_a_sweep_waits_for_the_part_to_the_west(monkeypatch):
    """Rows of random data, up and down, with more threads than cores: values by `kernels.sweep` itself."""
    from lcp_lube.solvers.fas import kernels, loops

    monkeypatch.setenv(crew.VARIABLE, "3")
    random = np.random.default_rng(0)
    shape = (310, 402)
    z = random.standard_normal(shape)
    kx, ky = (np.exp(random.standard_normal(s)) for s in ((shape[0], shape[1] + 1), (shape[0] + 1, shape[1])))
    c = random.standard_normal(shape)
    for count, down in ((1, True), (3, False), (7, True)):
        one, three = z.copy(), z.copy()
        kernels.sweep(one, kx, ky, c, count, down, None, False)
        loops.sweep(three, kx, ky, c, count, down, None, False)
        assert np.array_equal(one, three) and not np.array_equal(one, z)


def test_small_films_start_no_thread(monkeypatch):
    monkeypatch.setenv(crew.VARIABLE, "2")
    crew._crew.cache_clear()
    solve("problem4", method="fas", n=100).destroy()
    assert crew.crew()._others is None


def test_how_many_threads(monkeypatch):
    monkeypatch.delenv(crew.VARIABLE, raising=False)
    assert crew.threads() == 1
    for wrong in ("0", "two", "-1"):
        monkeypatch.setenv(crew.VARIABLE, wrong)
        with pytest.raises(InputError, match="whole number from 1"):
            crew.threads()


def test_settings_of_arithmetic_reach_every_thread():
    with np.errstate(divide="ignore"):
        found = crew.Crew(2).run(lambda k: np.geterr()["divide"], 4)
    assert found == ["ignore"] * 4


def test_a_task_asks_for_more():
    """Its own thread does what it asks for; the parts' order is kept."""
    team = crew.Crew(2)
    assert team.run(lambda k: team.run(lambda m: 10 * k + m, 2), 3) == [[0, 1], [10, 11], [20, 21]]
    assert team.run(lambda k: k, 2, together=True) == [0, 1]


MODULES = [f"lcp_lube.solvers.fas.{path.stem}" for path in Path(fas.__file__).parent.glob("*.py")]


def test_what_loops_call_is_part_of_them():
    """Machine code has no loop of ours that another one calls: which copy of it runs would depend on what was loaded before."""
    Dispatcher = pytest.importorskip("numba.core.dispatcher").Dispatcher
    found = {}
    for name in [*MODULES, "lcp_lube.problems.film.cell_loops"]:
        for loop in vars(import_module(name)).values():
            if isinstance(loop, Dispatcher):
                used = (loop.py_func.__globals__.get(word) for word in loop.py_func.__code__.co_names)
                found |= {one: one.targetoptions.get("forceinline") for one in used if isinstance(one, Dispatcher)}
    assert len(found) > 30 and all(found.values()), [one for one, part in found.items() if not part]
