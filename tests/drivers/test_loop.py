"""The loop of effects where Anderson's method does not settle: Newton's method goes on, and what is told is the best state."""

import numpy as np
import pytest

from lcp_lube import solve
from lcp_lube.drivers.effects import loop, nonlinear
from lcp_lube.drivers.effects.coupled_newton import CoupledNewton

FILM = [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}]
SOFT = {"family": "bearing", "L": 0.1, "U": 5.0, "n": 24, "fluid": {"mu": 0.02, "p_supply": 1e5}, "film": FILM}
SOFT["elastic"] = {"compliance": 3e-10}  # it drags more than pressure drives through a mesh


@pytest.mark.parametrize("how", ["for film and effects as one", "with films"])
def test_newton_goes_on_between_soft_walls(how, monkeypatch):
    """With the walls in the same steps no film is needed for them; by films alone it takes many."""
    monkeypatch.setattr(loop, "MOST_SOLVES", 30)
    monkeypatch.setattr(loop, "PATIENCE", 0)
    if how == "with films":
        monkeypatch.setattr(loop, "FIRST", np.inf)
    with solve(SOFT, model="full") as s:
        assert s.converged and s.certificate.holds and s.certificate.measures["coupling"] < 1e-8
        assert any(f"Newton's method {how}" in one for one in s.settings["why"])
        assert (s.settings["details"]["fluid_solves"] < 20) == (how != "with films")
        h, p = s.problem.scheme.h.ravel(), s.fields["p"] * s.problem.p_unit
        rigid = 2e-5 + 2e-5 * (1.0 - s.problem.grid.x / 0.1)
        assert h == pytest.approx(rigid.ravel() + 3e-10 * p, rel=1e-7)


def test_newton_goes_on_in_a_time_step(monkeypatch):
    march = {**SOFT, "motion": {"t_end": 0.02, "steps": 2, "start": "full"}}
    with solve(march, model="full") as s:
        load = s.load
    monkeypatch.setattr(loop, "PATIENCE", 0)
    with solve(march, model="full") as s:
        assert s.converged and s.load == pytest.approx(load, rel=1e-7)


def test_a_step_of_newtons_method_that_overflows_is_halved(monkeypatch):
    own, calls = CoupledNewton._left, list[int]()

    def left(self, p, r, x):
        calls.append(len(calls))
        return own(self, p, r, x) * (np.inf if len(calls) == 2 else 1.0)

    monkeypatch.setattr(loop, "MOST_SOLVES", 30)
    monkeypatch.setattr(loop, "PATIENCE", 0)
    monkeypatch.setattr(CoupledNewton, "_left", left)
    with np.errstate(invalid="ignore"), solve(SOFT, model="full") as s:
        assert s.converged and len(calls) > 2


def test_what_does_not_settle_ends_at_its_best(monkeypatch):
    """Not at the last film, and says where it began anew."""
    changes, found = [], loop.Loop._found

    def recorded(self, x, watch):
        made = found(self, x, watch)
        changes.append(np.max(np.abs(x - made)))
        return made

    monkeypatch.setattr(loop, "MOST_SOLVES", 30)
    monkeypatch.setattr(loop, "PATIENCE", 0)
    monkeypatch.setattr(loop, "FIRST", np.inf)
    monkeypatch.setattr(nonlinear, "VAIN", -1)
    monkeypatch.setattr(loop.Loop, "_found", recorded)
    with solve(SOFT, model="full") as s:
        assert s.outcome == "max_iterations" and f"{min(changes):.1e}" in s.message
        assert s.certificate.measures["coupling"] == pytest.approx(min(changes), rel=1e-6)


class Swinging:
    """What a loop leaves behind whose fields its effects throw to the other side, by `pull` times as much."""

    def __init__(self, pull):
        self.pull, self.change, self.told, self.solves = pull, np.inf, [], 0

    @property
    def found(self):
        return self.change <= 1e-9

    def off(self, x, watch):
        self.solves += 1
        change = (1.0 + self.pull) * np.sin(x)  # G(x) = x - change
        return np.max(np.abs(change)), change


def test_half_steps_settle_where_whole_ones_swing():
    """And end where the least change no longer halves."""
    swings, far = Swinging(1.5), np.array([0.9, -0.4])
    least = nonlinear.by_half_steps(swings, (np.inf, far), lambda: None)
    assert swings.found and least[0] == swings.change and np.max(np.abs(least[1])) < 1e-9 and swings.solves < 50
    swings = Swinging(3.5)
    least = nonlinear.by_half_steps(swings, (np.inf, far), lambda: None)
    most = 3 * nonlinear.PATIENT
    assert not swings.found and nonlinear.PATIENT <= swings.solves < most and least[0] < np.inf
