"""The loop of effects where Anderson's method does not settle: Newton's method goes on, and what is told is the best state."""

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.effects import loop, nonlinear, settling
from lcp_lube.drivers.effects.coupled_newton import CoupledNewton
from lcp_lube.linear.krylov import LinearSolverError
from lcp_lube.problems.film import certify

FILM = [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}]
SOFT = {"family": "bearing", "L": 0.1, "U": 5.0, "n": 24, "fluid": {"mu": 0.02, "p_supply": 1e5}, "film": FILM}
SOFT["elastic"] = {"compliance": 3e-10}  # it drags more than pressure drives through a mesh


@pytest.mark.parametrize("how", ["for film and effects as one", "with films"])
def test_newton_goes_on_between_soft_walls(how, monkeypatch):
    """With the walls in the same steps no film is needed for them; by films alone it takes many."""
    monkeypatch.setattr(settling, "MOST_SOLVES", 30)
    monkeypatch.setattr(settling, "PATIENCE", 0)
    if how == "with films":
        monkeypatch.setattr(settling, "FIRST", np.inf)
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
    monkeypatch.setattr(settling, "PATIENCE", 0)
    with solve(march, model="full") as s:
        assert s.converged and s.load == pytest.approx(load, rel=1e-7)


def test_a_step_of_newtons_method_that_overflows_is_halved(monkeypatch):
    own, calls = CoupledNewton._left, list[int]()

    def left(self, p, r, x):
        calls.append(len(calls))
        return own(self, p, r, x) * (np.inf if len(calls) == 2 else 1.0)

    monkeypatch.setattr(settling, "MOST_SOLVES", 30)
    monkeypatch.setattr(settling, "PATIENCE", 0)
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

    monkeypatch.setattr(settling, "MOST_SOLVES", 30)
    monkeypatch.setattr(settling, "PATIENCE", 0)
    monkeypatch.setattr(settling, "FIRST", np.inf)
    monkeypatch.setattr(nonlinear, "VAIN", -1)
    monkeypatch.setattr(loop.Loop, "_found", recorded)
    with solve(SOFT, model="full") as s:
        assert s.outcome == "max_iterations" and f"{min(changes):.1e}" in s.message
        assert s.certificate.measures["coupling"] == pytest.approx(min(changes), rel=1e-6)


def test_a_matrix_without_factors_ends_newtons_method_for_film_and_effects(monkeypatch):
    """Of a viscosity that grew beyond all bounds, say; films go on."""

    def fails(self, R):
        raise LinearSolverError("no factors")

    monkeypatch.setattr(settling, "PATIENCE", 0)
    monkeypatch.setattr(CoupledNewton, "_size_of", fails)
    with solve(SOFT, model="full") as s:
        assert s.converged and any("Newton's method for film and effects as one" in one for one in s.settings["why"])


class Swinging:
    """What a loop leaves behind whose fields its effects throw to the other side, by `pull` times as much."""

    def __init__(self, pull):
        self.pull, self.change, self.told, self.solves = pull, np.inf, [], 0

    @property
    def found(self):
        return self.change <= 1e-9

    def off(self, x, watch):
        self.solves += 1
        change = (1.0 + self.pull) * np.sin(x) if self.pull else np.where(x > 0.1, 1.0, -1.0)  # G(x) = x - change
        return np.max(np.abs(change)), change


@pytest.mark.parametrize("pull", [1.5, 3.5, 12.0])
def test_half_steps_settle_where_whole_ones_swing(pull):
    """And get shorter where half of one swings too."""
    swings, far = Swinging(pull), np.array([0.9, -0.4])
    least = nonlinear.by_half_steps(swings, (np.inf, far), lambda: None)
    assert swings.found and least[0] == swings.change and np.max(np.abs(least[1])) < 1e-9 and swings.solves < 80


def test_half_steps_end_where_the_least_change_no_longer_halves():
    jumps = Swinging(0.0)
    least = nonlinear.by_half_steps(jumps, (np.inf, np.array([0.9, -0.4])), lambda: None)
    assert not jumps.found and nonlinear.PATIENT <= jumps.solves < 3 * nonlinear.PATIENT and least[0] < np.inf


def hot_line(n, shape, **more):
    return {"family": "bearing", "scheme": "face", "n": n, "film": [shape], **more}


def test_the_pressure_behind_a_restrictor_heeds_what_effects_do():
    """By the film's own slope each step would throw it to the other side by 0.8 of what it was off."""
    hole, fed = {"x": [3.7e-4, 8e-4], "p": 1.28e5}, {"x": [2.17e-3, 2.93e-3], "restrictor": "capillary", "backflow": True}
    data = hot_line(
        40, {"shape": "constant", "h": 1.033e-5}, L=0.0068633, U=-1.64049, fluid={"mu": 0.0374, "p_supply": 1.7237e7}
    )
    data |= {"sides": {"east": 7.367e6}, "supply": [hole, {**fed, "p_s": 1.27778e8, "K": 3.8234e-13}]}
    data |= {"temperature": {"beta": 0.026393, "exchange": 477.968}, "shear": {"law": "eyring", "tau_0": 12735.3}}
    with solve(data, model="full") as s:
        assert s.converged and s.certificate.measures["heat_defect"] < 1e-8


WAVES = {"shape": "sinusoid", "h_min": 4e-5, "h_max": 1.1e-4, "waves": 3}
ORIFICE = {"x": [0.005, 0.0057], "restrictor": "orifice", "p_s": 4.1e5, "K": 2.4e-8, "backflow": True}
ROUND = {"L": 0.0079, "U": -1.04, "fluid": {"mu": 0.032, "p_supply": 4.3e5}, "supply": [ORIFICE]}
ROUND["sides"] = {"west": "periodic", "east": "periodic"}
WEDGE = {"shape": "linear", "h_start": 3e-6, "h_end": 1.4e-6}
CAPILLARY = {"x": [0.0008, 0.0019], "restrictor": "capillary", "p_s": 2.4e8, "K": 9.2e-17, "backflow": True}
ENDED = {"L": 0.008, "U": -0.29, "fluid": {"mu": 0.0067, "p_supply": 8.7e5}, "supply": [CAPILLARY]}
ENDED["sides"] = {"west": "closed", "east": 3.9e6}


@pytest.mark.parametrize("model, n, shape, data", [("effective", 3, WAVES, ROUND), ("energy", 31, WEDGE, ENDED)])
def test_oil_that_does_not_flow_off_is_told_soon(model, n, shape, data):
    """Its flow is rounding, however thin it gets; so is its heat beside what pressure makes of thin oil."""
    with solve(hot_line(n, shape, **data, temperature={"model": model, "beta": 0.047}), model="full") as s:
        assert s.outcome == "no_solution" and "get ever hotter" in s.message
        assert s.settings["details"]["fluid_solves"] < 30


def test_oil_in_a_supply_from_which_nothing_leaves_is_what_arrives():
    """Whatever rounding makes of the flow behind it, up to a closed end."""
    data = hot_line(147, {"shape": "linear", "h_start": 1.15e-5, "h_end": 1.45e-5}, L=0.219, U=3.9e-5, fluid={"mu": 0.3})
    data |= {"sides": {"west": 5.1e6, "east": "closed"}, "supply": [{"x": [0.156, 0.178], "p": 1.33e6}]}
    data["temperature"] = {"beta": 0.0228, "T_in": 348.0, "exchange": 644.0, "T_wall": 345.0}
    with solve(data, model="full") as s:
        assert s.converged and s.settings["details"]["fluid_solves"] < 10
        inside = s.problem.held.mask.ravel()
        assert np.all(np.abs(s.problem.more_fields["T"][0][inside] - 345.0) < 0.01)


@pytest.mark.parametrize("beside", [{}, {"roughness": {"sigma": 2e-6}}, {"viscosity": {"factor": "1 + 5*x"}}])
def test_a_film_beyond_roelands_limit_is_told_by_its_first_films(beside):
    """Also beside effects that are the same for every answer: one film has them, and constant viscosity."""
    data = hot_line(60, FILM[0], L=0.1, U=300.0, fluid={"mu": 0.2}, roelands={"z": 0.8}, **beside)
    with solve(data, model="full") as s:
        assert s.outcome == "no_solution" and "Roelands" in s.message
        assert s.settings["details"]["fluid_solves"] <= 2


@pytest.mark.parametrize(
    "beside, films", [({"temperature": {"beta": 1e-3, "T_in": 320.0}}, 10), ({"elastic": {"compliance": 1e-16}}, 70)]
)
def test_and_beside_what_may_change_it_yet_after_some_more(beside, films):
    """Heat and soft walls have had their say by then; Eyring's law leaves the logarithm of what grows, which has no limit.

    Between soft walls rounding decides at which of the looks, after 24, 34, 48 films, an iterate shows it: 26 to 50 here."""
    data = hot_line(60, FILM[0], L=0.1, U=300.0, fluid={"mu": 0.2}, roelands={"z": 0.8}) | beside
    with solve(data, model="full") as s:
        assert s.outcome == "max_iterations" and "Roelands" in s.message
        assert s.settings["details"]["fluid_solves"] <= films
    with solve(data | {"shear": {"law": "eyring", "tau_0": 1e5}}, model="full") as s:
        assert "Roelands" not in s.message


def test_pressures_of_supplies_are_sought_from_where_effects_leave_an_answer():
    """Behind half of p_s the oil would be sheared to nothing: stresses of a hundred Eyring's."""
    film = [{"shape": "constant", "h": 2.88e-5}, {"shape": "step", "height": 3.58e-5, "at": 1.058e-3}]
    film.append({"shape": "step", "height": 3.09e-5, "at": 3.41e-4})
    data = {"family": "bearing", "L": 2.317e-3, "U": -0.145, "n": 5, "fluid": {"mu": 7.97e-3}, "film": film}
    data |= {"sides": {"west": "periodic", "east": "periodic"}, "shear": {"law": "eyring", "tau_0": 17.18}}
    fed = {"x": [2.83e-4, 5.77e-4], "restrictor": "capillary", "p_s": 1.027e5, "K": 7.87e-11, "backflow": True}
    with solve(data | {"supply": [fed, {"x": [1.504e-3, 1.83e-3], "flow": 1.783e-6}]}, model="full") as s:
        assert s.converged, s.message
        assert s.settings["supply_pressures"][0] == pytest.approx(1.027e5 + 1.783e-6 / 7.87e-11, rel=1e-6)


def test_asperities_that_push_far_more_than_the_film():
    """Their pressure is 35 times the film's unit: no step for each of these."""
    data = hot_line(
        20, {"shape": "linear", "h_start": 2e-6, "h_end": 1e-6}, L=0.01, U=1e-3, fluid={"mu": 0.01, "p_supply": 1e5}
    )
    data |= {"asperity": {"sigma": 5e-7, "E_reduced": 1e12}, "shear": {"law": "carreau", "time": 1e-3, "n": 0.5}}
    with solve(data, model="full") as s:
        assert s.problem.cells["contact"].max() > 30 * s.problem.p_unit
        assert s.converged and s.settings["details"]["fluid_solves"] < 15, s.message


def test_a_load_for_which_the_film_gets_too_hot():
    """Thinner films would carry it, had they an answer: it is told why they have none."""
    hot = {"shape": "parabola", "h_min": 1.24e-6, "h_max": 8.75e-6}
    pad = {"family": "bearing", "L": 2.3e-3, "U": 1.8, "n": 300, "film": [hot], "fluid": {"mu": 0.46, "p_supply": 1e8}}
    pad |= {"temperature": {"T_in": 290.0, "model": "effective", "beta": 0.005}, "balance": {"load": 2.7e6}}
    with solve(pad, model="full") as s:
        assert s.outcome.value == "load_not_carried"
        assert "has no answer: no steady temperature" in s.message.partition("balance.range was")[2]


@pytest.fixture
def looks(monkeypatch):
    """How often p was looked at closely."""
    calls, look = [], certify.p_error

    def counted(problem, p, r):
        calls.append(problem)
        return look(problem, p, r)

    monkeypatch.setattr(certify, "p_error", counted)
    return calls


def test_heat_that_goes_round_settles():
    """What films leave of cells' balances is no heat that oil takes round and round; with it the loop took 35 films."""
    heat = {"beta": 0.03, "T_in": 323.0, "rho": 855.0, "specific_heat": 1950.0}
    with solve(load_scene("ring_journal", {"nx": 180, "ny": 61, "attitude_deg": 50.0, "temperature": heat}), model="full") as s:
        assert s.converged and s.certificate.measures["heat_defect"] < 1e-8 and s.certificate.measures["coupling"] < 1e-8
        assert s.settings["details"]["fluid_solves"] <= 20 and not any("from film" in why for why in s.settings["why"])


def test_films_on_the_way_are_not_looked_at_closely(looks):
    """The first of each coupling and its answer alone."""
    with solve(load_scene("mixed_journal")) as s:
        assert s.converged and "p_error" in s.certificate.measures
        assert 2 <= len(looks) < 3 * s.settings["balance"]["solves"]


def test_of_a_free_journals_step_its_answer_is_looked_at_closely(looks, monkeypatch):
    monkeypatch.setattr(certify, "FINE", 0.0)
    with solve(load_scene("dynamic_journal", {"motion.t_end": 0.0008, "motion.steps": 4})) as s:
        solves = [row["solves"] for row in s.history]
        assert s.converged and sum(solves) > 8 and len(looks) <= 4 + 3


def test_heat_turns_round_as_far_as_cells_are_empty():
    """With all of it at the least void fields had no answer where a cell fills: the loop swung between two for 290 films."""
    scene = load_scene("herringbone_journal", {"nx": 48, "ny": 21, "temperature": {"beta": 0.0493253, "T_in": 323.0}})
    with solve(scene, model="full", method="active-set") as s:
        assert s.converged and s.settings["details"]["fluid_solves"] < 40
