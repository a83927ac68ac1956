"""Damaged input: never a traceback, never status 0 with a wrong answer, never a hang; bad input is one line.

`make mutations` runs all 2,000 cases of tests/mutations.py; a test run takes the first of them.
"""

import os
import re
import tempfile
import time
from pathlib import Path

import mutations
import pytest
from conftest import start
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from petsc4py import PETSc

from lcp_lube import load_scene, solve
from lcp_lube.__main__ import main
from lcp_lube.cli import main as cli
from lcp_lube.cli.arguments import parse
from lcp_lube.cli.asked import scene_of
from lcp_lube.cli.words import split
from lcp_lube.errors import InputError
from lcp_lube.registry import METHODS
from lcp_lube.scenes.scene import parse_changes

COUNT = int(os.environ.get("LCP_LUBE_MUTATIONS", "160"))
LIMIT = 60.0  # seconds a case may take on a machine with as many jobs as cores
BATCH = 40


def said(out: str, err: str, status: int) -> None:
    """The contract of what is printed."""
    refusals = [line for line in err.split("\n") if line.startswith("lcp-lube: ")]
    faults = {
        "a traceback": "Traceback" in out + err or "PETSC ERROR" in out + err,
        f"status {status}": status not in (0, 1, 2),
        f"{len(refusals)} refusals": status == 2 and len(refusals) != 1,
        "more than the refusal": status == 2 and [line for line in err.split("\n") if line.strip()] != refusals,
        "a long refusal": status == 2 and len(max(refusals, default="")) > 1000,
        "a refusal that is not printable": status == 2 and not all(map(str.isprintable, refusals)),
    }
    found = [fault for fault, there in faults.items() if there]
    assert not found, f"{', '.join(found)}: {err[-700:]!r}"


class Judge:
    """Runs cases in this process and tells whether a status 0 is deserved."""

    def __init__(self, capfd, monkeypatch):
        self.capfd, self.answers, self.known = capfd, [], {}
        honest = cli.as_dict

        def watched(solution):
            self.answers.append((solution.problem.kind, honest(solution)))
            return self.answers[-1][1]

        monkeypatch.setattr(cli, "as_dict", watched)

    def run(self, words, petsc):
        """Status, stdout, stderr and the answer, if there was one."""
        self.answers.clear()
        options = PETSc.Options()
        for name, value in petsc.items():
            options.setValue(name, value)
        try:
            status = main(list(words))
        except SystemExit as ended:  # argparse's --help
            status = ended.code
        finally:
            for name in options.getAll():
                options.delValue(name)
        out, err = self.capfd.readouterr()
        return status, out, err, (self.answers[-1] if self.answers else (None, None))

    def __call__(self, case):
        begin = time.monotonic()
        if case.separate:
            run = start(["-m", "lcp_lube", *case.words], 1, Path.cwd(), timeout=2 * LIMIT)
            status, out, err, kind, answer = run.status, run.out, run.err, "lubrication", None
            if status == 0 and "--json" in case.words and "-help" not in case.words:
                answer = run.json
        else:
            status, out, err, (kind, answer) = self.run(case.words, case.petsc)
        said(out, err, status)
        load = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
        assert time.monotonic() - begin < LIMIT * load
        if status != 0 or answer is None:
            return
        assert answer["converged"] is True and answer["outcome"] == "converged"
        if case.same or case.separate:
            key = tuple(case.base)
            if key not in self.known:
                status, _, err, (_, self.known[key]) = self.run(case.base, {})
                assert status == 0, err
            agree(answer, self.known[key])
        elif case.kind == "scene":
            agree(answer, self.by_another_method(case, kind, answer))

    def by_another_method(self, case, kind, answer):
        """The same damaged scene solved by a method that has nothing in common with the one that was used."""
        other = {"lubrication": "monotone", "box": "semismooth"}.get(kind)
        if other is None or kind not in METHODS[other].kinds:
            return None
        solution = solve(scene_of(parse(case.words)), method=other, nested=False)
        try:
            return solution.problem.quantities(solution.fields) if solution.converged else None
        finally:
            solution.destroy()


def agree(answer, expected):
    """Two answers to the same question, by their numbers; loads below 1 N and pressures below 1 Pa are none."""
    floor = 1.0 if answer.get("load") is not None else 1e-3
    for key in ("p_max", "load", "max_v", "sum_v") if expected is not None else ():
        if answer.get(key) is not None and expected.get(key) is not None:
            assert answer[key] == pytest.approx(expected[key], rel=1e-3, abs=floor), key


@pytest.mark.parametrize("batch", range(0, COUNT, BATCH))
def test_damaged_command_lines(tmp_path, monkeypatch, capfd, batch):
    monkeypatch.chdir(tmp_path)
    mutations.furnish(tmp_path)
    judge, failed = Judge(capfd, monkeypatch), []
    for k in range(batch, min(batch + BATCH, COUNT)):
        case = mutations.case(k, tmp_path)
        try:
            judge(case)
        except Exception as error:
            capfd.readouterr()
            words = " ".join(repr(word[:60]) for word in case.words)
            failed.append(f"case {k}: {words} {case.petsc or ''}\n    {type(error).__name__}: {str(error)[:900]}")
    assert not failed, "\n".join(failed)


# --- laws

TEXT = st.text(max_size=20)
SCALARS = st.one_of(
    st.integers(-(10**20), 10**20), st.floats(), st.booleans(), TEXT.filter(lambda text: text.isprintable() and '"' not in text)
)
KEYS = st.sampled_from(
    """family name scheme dimension L width mu U p_a p_b p_side p_c n nx ny film form wave h_min h_max x y fluid lambda K
    seed""".split()  # noqa: SIM905
)


def toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"'{value}'" if "'" not in value else f'"{value}"'
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return repr(value)


@given(st.dictionaries(KEYS, st.one_of(SCALARS, st.lists(SCALARS, max_size=3)), max_size=6))
@hypothesis_settings(max_examples=100)
def test_any_scene_loads_or_is_refused(data):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.toml"
        path.write_text(
            "family = 'slider'\n" * ("family" not in data) + "".join(f"{key} = {toml(value)}\n" for key, value in data.items()),
            encoding="utf-8",
        )
        try:
            scene = load_scene(path)
        except InputError as error:
            assert "\n" not in str(error) and str(error).startswith(str(path))
        else:
            assert all(n >= 1 for n in scene.shape)


@given(
    st.lists(
        st.one_of(TEXT, st.sampled_from(["solve", "problem1", "--n", "--set", "-ksp_type", "--", "-x", "--json"])), max_size=6
    )
)
@hypothesis_settings(max_examples=200)
def test_any_words_parse_or_are_refused(words):
    try:
        parse(split(words)[0])
    except InputError as error:
        assert "\n" not in str(error)
    except SystemExit as ended:
        assert ended.code == 0 and {"-h", "--help", "--version"} & set(words)


@given(st.lists(TEXT, max_size=3))
def test_any_assignment_parses_or_is_refused(assignments):
    try:
        changes = parse_changes(assignments)
    except InputError as error:
        assert re.match(r"--set ", str(error)) and "\n" not in str(error)
    else:
        assert all(isinstance(key, str) and key for key in changes)
