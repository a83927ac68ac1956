"""One file and one line for a thing of each kind: toys from outside are found wherever names are listed and used."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ENVIRONMENT

TOYS = Path(__file__).parents[1] / "toys"
FILM = 'film = [{ shape = "linear", h_start_um = 4, h_end_um = 2 }]\n'
PAD = 'family = "bearing"\nL_mm = 10\nU = 1\nfluid.mu = 0.01\n'
FILES = {
    "family.toml": 'family = "toy-family"\nn = 30\n',
    "shape.toml": f'{PAD}n = 20\nfilm = [{{ shape = "toy-shape", h_um = 2 }}]\n',
    "toy.toml": f"{PAD}n = 300\ntoy_liner.D = 1e-14\n{FILM}",
    "elastic.toml": f"{PAD}n = 300\nelastic.compliance = 1e-14\n{FILM}",
}
COMMANDS = {
    "list": "list",
    "help": "chart stability --help",
    "family": "solve family.toml --method toy-method --json --explain",
    "new": "new c.toml --from family.toml",
    "shape": "solve shape.toml --json",
    "toy": "solve toy.toml --json",
    "elastic": "solve elastic.toml --json",
    "least": "solve toy.toml --model least --json",
    "compare": "compare problem1 --n 30 --methods toy-method,active-set --json",
    "chart": "chart stability toy-map --quick",
}
# All of them in one process, which begins as any command does and finds the toys by their entry point.
PROGRAM = """
import contextlib, io, json, sys
from lcp_lube.cli.arguments import parse
from lcp_lube.cli.main import run
told = {}
for name, words in json.load(sys.stdin).items():
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = run(parse(words.split()))
        except SystemExit as end:
            status = end.code or 0
    told[name] = status, out.getvalue(), err.getvalue()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Status, output and errors of each command, in a folder that has nothing but the scenes."""
    folder = tmp_path_factory.mktemp("outside")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    paths = os.pathsep.join([str(TOYS), ENVIRONMENT["PYTHONPATH"]])
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=folder,
        env={**ENVIRONMENT, "PYTHONPATH": paths},
        input=json.dumps(COMMANDS),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {name: status for name, (status, _, _) in found.items()} == dict.fromkeys(COMMANDS, 0)
    return {name: (out, err) for name, (_, out, err) in found.items()}


def test_toys_are_listed(told):
    for name in ("toy-method", "toy-shape", "toy-family", "toy-driver", "toy-map", "toy_liner"):
        assert f"  {name}" in told["list"][0], name
    assert "toy-map, a toy" in told["help"][0]


def test_toys_solve(told):
    """A family, a method and a driver; then a film shape."""
    out, err = told["family"]
    assert json.loads(out)["method"] == "toy-method" and "the toy driver was here" in err
    assert json.loads(told["shape"][0])["min_h"] == pytest.approx(2e-6)


def test_a_toy_effect(told):
    """An effect from outside is solved for, certified, named and left out as the package's own; it is what [elastic] does."""
    toy, elastic, least = (json.loads(told[name][0]) for name in ("toy", "elastic", "least"))
    assert toy["coupling"] < 1e-8 and elastic["coupling"] < 1e-8
    assert toy["load"] == pytest.approx(elastic["load"], rel=1e-9)
    assert "toy_liner" in least["model"]["left_out"]


def test_toys_are_compared_and_charted(told):
    rows = json.loads(told["compare"][0])
    assert [row["outcome"] for row in rows] == ["converged"] * 2 and rows[0]["p_max"] == pytest.approx(rows[1]["p_max"])
    assert "the toy's map" in told["chart"][0]
