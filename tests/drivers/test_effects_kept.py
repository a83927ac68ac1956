"""Films with effects: their runs are taken up from files as if not stopped, and have bands at what was found for them."""

from dataclasses import replace

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers import direct
from lcp_lube.drivers.ask import Ask
from lcp_lube.drivers.checkpoint import Checkpointer
from lcp_lube.drivers.effects.frozen import Frozen
from lcp_lube.errors import InputError
from lcp_lube.problems.film.effects import factors
from lcp_lube.problems.film.fluid import Law

FLUID = {"mu": 0.02, "p_supply": 1e5}
CAVITY = [{"shape": "sinusoid", "h_min": 8e-6, "h_max": 2e-5}]
WARM = {"beta": 0.03, "T_in": 320.0}
PAD = {"family": "bearing", "L": 0.1, "U": 5.0, "n": 199, "fluid": FLUID, "film": CAVITY}
LAWS = {**FLUID, "barus": 2e-8, "density": "dowson-higginson"}
SCENES = {
    "hot": {**PAD, "fluid": LAWS, "temperature": WARM},
    "soft": {**PAD, "elastic": {"compliance": 2e-12}, "shear": {"law": "eyring", "tau_0": 1e5}},
    "wide": {**PAD, "dimension": 2, "width": 0.08, "nx": 79, "ny": 39, "fluid": LAWS, "temperature": WARM},
    "barus": {**PAD, "dimension": 2, "width": 0.08, "nx": 39, "ny": 19, "fluid": {**FLUID, "barus": 2e-8}},
    "decided": {**PAD, "n": 999, "temperature": WARM, "shear": {"law": "eyring", "tau_0": 1e7}},
}


class Stopped(Exception):
    """As a kill right after a checkpoint."""


def stopped(data, path, after, monkeypatch, **how):
    """Solve until so many checkpoints are written; whether the run was stopped by that."""
    count, write = 0, Checkpointer.write

    def counted(self, *given):
        nonlocal count
        write(self, *given)
        count += 1
        if count == after:
            raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(Checkpointer, "write", counted)
        try:
            solve(data, checkpoint=path, **how).destroy()
        except Stopped:
            return True
    return False


@pytest.fixture(scope="module")
def unstopped(tmp_path_factory):
    """`unstopped("hot")`: the answer of a run that writes checkpoints as well; each is solved for once."""
    known, path = {}, tmp_path_factory.mktemp("whole") / "c"

    def answer(name):
        if name not in known:
            known[name] = solve(SCENES[name], checkpoint=path)
            path.unlink(missing_ok=True)
        return known[name]

    yield answer
    for solution in known.values():
        solution.destroy()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("after", [1, 3, 99])
def test_taken_up_as_if_not_stopped(name, after, tmp_path, monkeypatch, unstopped):
    """The same films on every grid, and the same fields to the last digit; a run that was done solves its last film again."""
    whole = unstopped(name)
    cut = stopped(SCENES[name], tmp_path / "c", after, monkeypatch)
    with solve(SCENES[name], resume=tmp_path / "c") as s:
        assert s.converged and cut == (after < 99)
        for key in ("fluid_solves", "coupling_work"):
            assert s.settings["details"][key] == whole.settings["details"][key]
        for field, values in whole.fields.items():
            np.testing.assert_allclose(s.fields[field], values, rtol=0, atol=0.0 if cut else 1e-12 * np.max(np.abs(values)))
        assert {**s.settings.get("model", {}), "seconds": 0} == {**whole.settings.get("model", {}), "seconds": 0}


def test_other_ranks_go_on(cli, tmp_path, monkeypatch):
    asked = ("solve", "pocketed_pad_2d", "--nx", 79, "--ny", 39, "--model", "full", "--json")
    scene = load_scene("pocketed_pad_2d", {"nx": 79, "ny": 39})
    assert stopped(scene, tmp_path / "c", 3, monkeypatch, model="full")
    one, two = cli(*asked), cli(*asked, "--resume", "c", ranks=2)
    assert (one.status, two.status) == (0, 0), two.err
    for key in ("load", "p_max", "friction"):
        assert two.json[key] == pytest.approx(one.json[key], rel=1e-8)


def test_refused(tmp_path, monkeypatch):
    assert stopped(SCENES["hot"], tmp_path / "c", 2, monkeypatch)
    with pytest.raises(InputError, match="another scene: its temperature"):
        solve({**SCENES["hot"], "temperature": {**WARM, "beta": 0.02}}, resume=tmp_path / "c")
    with pytest.raises(InputError, match="begun with method auto, not din"):
        solve(SCENES["hot"], resume=tmp_path / "c", method="din")
    text = (tmp_path / "c").read_bytes()
    (tmp_path / "c").write_bytes(text[:-9] + b"x" + text[-8:])
    with pytest.raises(InputError, match=r"--resume .*damaged: fields.r is not what was written"):
        solve(SCENES["hot"], resume=tmp_path / "c")
    (tmp_path / "c").write_bytes(text[:-9])
    with pytest.raises(InputError, match=r"--resume .*cut short"):
        solve(SCENES["hot"], resume=tmp_path / "c")


@pytest.mark.parametrize("name", SCENES)
def test_band(name):
    """Another method's answer of the film with what was found held, to more digits, lies within."""
    with solve(SCENES[name], certify=True, model="full") as s:
        band = s.enclosure
        assert s.converged and band.certified, band.message
        assert band.bounds["band_p"] < 1e-6 * s.p_max
        assert ("held as found" in band.message) == (name != "barus")
        law = s.solved_scene.model.law or Law()
        film = Frozen(s.solved_scene, law)
        cells = getattr(s.problem, "cells", {})
        if cells:
            sides = [float(law.density(np.array(side.p))) for side in s.solved_scene.model.sides]
            film = replace(film, by=factors(film.build(), cells, sides))
        other = direct.solve(film, Ask(method="monotone", stopping={"eps1": 1e-12}))
        other.fields["p"] = law.pressure(other.fields["p"] * other.problem.p_unit) / other.problem.p_unit
        for field, (low, high) in {"p": (band.lower, band.upper), "r": (band.upper, band.lower)}.items():
            slack = 1e-9 * np.max(other.fields[field])  # of the other answer
            assert np.all(other.fields[field] >= low[field] - slack) and np.all(other.fields[field] <= high[field] + slack)
        other.destroy()


def test_a_band_says_what_it_covers(cli):
    run = cli("solve", "lined_pad", "--n", 299, "--certify")
    assert run.status == 0 and "proved: " in run.out and "held as found, which the effects still change by" in run.out
