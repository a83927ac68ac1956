"""Every recipe, method and system on every number of ranks and kind of sides: right, refused with a reason, or failed openly.

A test run takes a tenth by a fresh seed, which it prints, of which a few on several ranks: where these outnumber the cores
every inner iteration waits for the scheduler. LCP_LUBE_SEED repeats a run, `make mutations` runs everything.
"""

import json
import os
import random
import subprocess
from dataclasses import asdict
from pathlib import Path

import pytest
from combinations import Combination, everything, tenth
from conftest import TESTS, start

ALL = "LCP_LUBE_MUTATIONS" in os.environ
SEED = int(os.environ.get("LCP_LUBE_SEED", random.SystemRandom().randrange(10**6)))
JOBS = 40 if ALL else 1  # for a number of ranks
FEW = 8


def faults(cases: list[Combination], ranks: int, folder: Path) -> tuple[list[str], list[str]]:
    """Outcomes, and what must not be: wrong answers, exceptions, a crash, a hang."""
    (folder / "cases.json").write_text(json.dumps([asdict(case) for case in cases]))
    end = ""
    try:
        job = start([str(TESTS / "combinations.py"), "cases.json", "record"], ranks, folder, timeout=500 + 10 * len(cases))
        end = f"status {job.status}: {job.err[-500:]}" if job.status else ""
    except subprocess.TimeoutExpired:
        end = "hangs"
    lines = [json.loads(line) for line in (folder / "record").read_text().splitlines()]
    begun, outcomes = lines[::2], lines[1::2]
    found = [f"{case}: {out}" for case, out in zip(begun, outcomes, strict=False) if out.startswith(("WRONG", "ERROR"))]
    if end or len(outcomes) < len(cases):
        found.append(f"{begun[-1] if begun else 'before the first'}: {end or 'no end'}")
    return outcomes, found


@pytest.mark.timeout(3000)
@pytest.mark.parametrize("part", range(JOBS))
@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_right_or_refused_or_an_open_failure(tmp_path: Path, ranks: int, part: int) -> None:
    print(f"LCP_LUBE_SEED={SEED}")
    cases = [case for case in (everything if ALL else tenth)(SEED) if case.ranks == ranks][part::JOBS]
    if ranks > 1 and not ALL:
        cases = cases[:FEW]
    outcomes, found = faults(cases, ranks, tmp_path)
    assert not found, f"LCP_LUBE_SEED={SEED}: " + "\n".join(found)
    assert len(cases) <= FEW or outcomes.count("converged") > 0.2 * len(outcomes)


def test_a_zero_on_the_diagonal_of_one_rank_fails_on_all(tmp_path: Path) -> None:
    """SOR raised there, and the other ranks waited for ever."""
    cases = [
        Combination("sor", "active-set", "full", "ring", 3, (9, 1), 0),
        Combination("multigrid", "active-set", "full", "pressures", 3, (3, 41), 2),
        Combination("bcgs_ml", "active-set", "full", "ring, mirror", 3, (7, 5), 0),
    ]
    outcomes, found = faults(cases, 3, tmp_path)
    assert not found and set(outcomes) == {"converged"}
