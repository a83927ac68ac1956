"""`lcp-lube verify`: the known answers hold, and a wrong reference, scheme or solve does not pass."""

import argparse
import json
from dataclasses import replace

import pytest

from lcp_lube.api import solve
from lcp_lube.cli import verify
from lcp_lube.cli.verify import quick_cases, table
from lcp_lube.problems.film import reynolds
from lcp_lube.registry import scene_names
from lcp_lube.studies.verify_cases import CASES


@pytest.fixture(scope="module")
def verdicts():
    return verify.verify()


def test_all_cases_pass(verdicts):
    assert [verdict.case.name for verdict in verdicts if not verdict.passed] == []
    text = table(verdicts)
    assert "FAIL" not in text
    assert f"{len(CASES)} of {len(CASES)} cases pass" in text


def test_what_is_covered():
    """All reference scenes, each with the source of its values; three grids but where the reference is one grid's own."""
    scenes = {case.scene for case in CASES}
    assert scenes <= set(scene_names())
    assert scenes >= {"pocketed_pad", "parabolic_slider", "long_journal", "journal", "textured_slider", "obstacle_ball"}
    assert scenes >= {"problem1", "problem2", "problem3", "squeeze"}
    assert all(case.source and case.references for case in CASES)
    assert all(len(case.grids) == 3 for case in CASES if case.scene != "textured_slider")
    assert len({case.name for case in CASES}) == len(CASES)


def test_orders_of_exact_cases(verdicts):
    """Second order where no front moves in its cell; on average, from grids 16 apart, where one does."""
    exact = [row for v in verdicts if v.case.name in ("pocketed pad", "long journal, eps = 0.5") for row in v.rows]
    assert sum(row.steady for row in exact) >= 8  # scheme face in 1D: every grid has the film's own numbers
    rows = [row for v in verdicts for row in v.rows if v.case.scene.startswith("problem")]
    fronts = [row.order for row in rows if row.errors[-1] > verify.ROUNDING]
    assert len(fronts) >= 13
    assert sum(fronts) / len(fronts) > 1.7


def wrong_quick_case():
    (case,) = quick_cases()
    load = case.references["pressure_integral"]
    return replace(case, references={**case.references, "pressure_integral": replace(load, value=load.value * (1 + 1e-4))})


def test_wrong_reference_fails(monkeypatch, capsys):
    monkeypatch.setattr(verify, "CASES", (wrong_quick_case(),))
    assert verify.run(argparse.Namespace(quick=False, json=False)) == 1
    out = capsys.readouterr().out
    assert "FAIL: 1.0e-04 > 2e-06" in out
    assert "0 of 1 cases pass" in out
    assert verify.run(argparse.Namespace(quick=False, json=True)) == 1
    data = json.loads(capsys.readouterr().out)
    assert not data["passed"]
    assert [row["quantity"] for row in data["cases"][0]["rows"] if not row["passed"]] == ["pressure_integral"]


@pytest.mark.parametrize("coefficient", ["k_E", "couette_E", "b_C"])
def test_wrong_scheme_fails(monkeypatch, coefficient):
    """Coefficients one in ten thousand off, once they are computed."""
    right = reynolds.coefficients

    def wrong(*args, **data):
        box = right(*args, **data)
        return replace(box, **{coefficient: 1.0001 * getattr(box, coefficient)})

    monkeypatch.setattr(reynolds, "coefficients", wrong)
    (verdict,) = verify.verify(quick_cases())
    assert not verdict.passed


def test_scheme_of_first_order_fails(monkeypatch):
    """Small errors that fall too slowly are told as such."""
    (case,) = quick_cases()
    slow = replace(case, data={"scheme": "upwind"}, references={"p_max": replace(case.references["p_max"], tol=1.0)})
    (verdict,) = verify.verify([slow])
    assert verdict.rows[0].fault.startswith("order 1.0") or verdict.rows[0].fault.startswith("order 0.9")


def test_failed_solve_fails(monkeypatch):
    monkeypatch.setattr(verify, "solve", lambda scene, **how: solve(scene, method="din", stopping={"max_it": 2}))
    (verdict,) = verify.verify(quick_cases())
    assert not verdict.passed
    assert len(verdict.failures) == 3
    assert "max_iterations" in verdict.failures[0]
    assert "FAIL" in table([verdict])


@pytest.mark.parametrize("ranks", [1, 2])
def test_command_line(cli, ranks):
    run = cli("verify", "--quick", "--json", ranks=ranks)
    assert run.status == 0, run.err
    (case,) = run.json["cases"]
    assert run.json["passed"] and case["passed"]
    load = next(row for row in case["rows"] if row["quantity"] == "pressure_integral")
    assert len(load["errors"]) == len(load["grids"]) == 3
    assert load["errors"][-1] == pytest.approx(abs(load["ours"] / load["reference"] - 1))
    assert load["source"]
