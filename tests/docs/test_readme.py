"""Every command and every program of the README runs as it stands there; figures that pages quote are those of their csv."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "README.md"
RESULTS = README.parent / "docs" / "results.md"
MOST_LINES = 70  # a screen and a half: as GitHub sets it 1,560 pixels at 894 wide, where a screen has 1,080
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", README.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
LINES = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
COMMANDS = [line for line in LINES if re.match(r"(mpiexec .*)?lcp-lube ", line)]
PROGRAMS = [block for kind, block in BLOCKS if kind == "python"]
SCENES = [block for kind, block in BLOCKS if kind == "toml"]
# What set-up is made of; run by `make`, not here.
SETUP = r"make( |$)|conda |pip |python3 -m venv |export |source |git |sudo |apt"


def with_command(tmp_path, python):
    """Variables with `lcp-lube` on the path, installed or not."""
    shim = tmp_path / "bin" / "lcp-lube"
    shim.parent.mkdir()
    shim.write_text(f'#!/bin/sh\nexec {shlex.join(python)} -m lcp_lube "$@"\n')
    shim.chmod(0o755)
    return {"PATH": f"{shim.parent}{os.pathsep}{os.environ['PATH']}"}


@pytest.fixture
def environment(tmp_path):
    """What stands first is run as a user runs it, in new processes."""
    return with_command(tmp_path, [sys.executable])


def run(command, tmp_path, environment):
    from conftest import ENVIRONMENT

    return subprocess.run(
        command, cwd=tmp_path, env={**ENVIRONMENT, **environment}, capture_output=True, text=True, timeout=240, check=False
    )


def test_nothing_in_the_readme_is_overlooked():
    """Each line of a shell block is run here or belongs to the set-up."""
    assert COMMANDS and PROGRAMS and SCENES
    assert [line for line in LINES if line and line not in COMMANDS and not re.match(SETUP, line)] == []


def test_it_is_a_screen_and_a_half_and_leads_on():
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    for target in re.findall(r"\]\(([^)#]+)", text):
        assert target.startswith("http") or (README.parent / target).exists(), target


@pytest.mark.parametrize("line", COMMANDS)
def test_commands(line, tmp_path, environment):
    done = run(["sh", "-c", line], tmp_path, environment)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    for name in re.findall(r"(?:--plot|--output) (\S+)", line):
        assert (tmp_path / name).stat().st_size > 0


@pytest.mark.parametrize("block", PROGRAMS)
def test_programs(block, tmp_path, environment):
    done = run([sys.executable, "-W", "error", "-c", block], tmp_path, environment)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("block", SCENES)
def test_scenes(block, tmp_path, environment):
    (tmp_path / "my.toml").write_text(block)
    done = run(["lcp-lube", "solve", "my.toml"], tmp_path, environment)
    assert done.returncode == 0, done.stderr


def test_what_is_said_of_the_maps_is_what_their_csv_say():
    root = README.parent
    script = [sys.executable, str(root / "benchmarks" / "map_table.py")]
    *table, _, words = subprocess.run(script, check=True, capture_output=True, text=True).stdout.strip().split("\n")
    compared = (root / "docs" / "comparison.md").read_text(encoding="utf-8")
    assert all(line in compared for line in table)
    assert words in RESULTS.read_text(encoding="utf-8")


def test_what_is_said_of_the_precision_chart_is_what_it_says():
    charts = (README.parent / "benchmarks" / "results" / "CHARTS.md").read_text(encoding="utf-8")
    times = re.search(r"Within 1 % fastest: .*? takes ([\d.]+ to [\d.]+) times", charts)
    assert times is not None
    assert f"takes {times[1]} times as long for 1 %" in RESULTS.read_text(encoding="utf-8")
