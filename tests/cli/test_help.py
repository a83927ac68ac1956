"""--help: an example a command, which runs; words completed in a shell; every option in the man page's source."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ENVIRONMENT

from lcp_lube.cli.arguments import GRAMMAR, parser_of_all
from lcp_lube.cli.main import COMMANDS
from lcp_lube.registry import METHODS, scene_names

EXAMPLES = {name: command["example"] for name, command in GRAMMAR["command"].items()}
PAGES = [page.read_text(encoding="utf-8") for page in (Path(__file__).parents[2] / "docs" / "guide").glob("*.md")]
GUIDE = {line.partition("  #")[0].strip() for page in PAGES for line in page.splitlines()}
# Run by tests of their own, or by the guide's, where the same command stands.
ELSEWHERE = {"explore", "doctor", "optimise", *(name for name, example in EXAMPLES.items() if example in GUIDE)}


def test_every_command_has_an_example_in_its_help() -> None:
    assert set(EXAMPLES) == set(COMMANDS)
    (commands,) = (action.choices for action in parser_of_all()._actions if isinstance(action.choices, dict))
    for name, parser in commands.items():
        assert f"example: {EXAMPLES[name]}" in " ".join(parser.format_help().split())


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name not in ELSEWHERE])
def test_examples_run(cli, name) -> None:
    if name == "solve":
        pytest.importorskip("matplotlib")
    done = cli(*shlex.split(EXAMPLES[name])[1:], timeout=240)
    assert done.status == 0, done.err


@pytest.mark.parametrize(
    "line, expected",
    [
        ("lcp-lube so", {"solve"}),
        ("lcp-lube solve problem", {"problem1", "problem2", "problem3", "problem4"}),
        ("lcp-lube solve --method di", {"din", "din-pc"}),
        ("lcp-lube compare problem1 --methods din,fbn", {"din,fbn-a", "din,fbn-i"}),
        ("lcp-lube solve problem1 --acc", {"--accuracy"}),
    ],
)
def test_completion(line: str, expected: set[str], tmp_path) -> None:
    pytest.importorskip("argcomplete")
    out = tmp_path / "words"
    environment = {
        **ENVIRONMENT,
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(out),
        "ARGCOMPLETE_USE_TEMPFILES": "1",
    }
    done = subprocess.run([sys.executable, "-m", "lcp_lube"], env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = {word.strip() for word in (out.read_text() if out.exists() else done.stdout).split("\n")}
    assert {word for word in found if word} == expected, done.stderr


def test_no_help_begins_with_what_a_man_page_takes_for_a_request() -> None:
    (commands,) = (action.choices for action in parser_of_all()._actions if isinstance(action.choices, dict))
    words = [action.help for parser in commands.values() for action in parser._actions if action.help]
    assert len(words) > len(commands) and not [word for word in words if word.startswith((".", "'"))]


def test_names_are_those_of_the_registry() -> None:
    from lcp_lube.cli.completion import NAMES

    assert NAMES["scene"]() == scene_names() and set(METHODS) < set(NAMES["method"]())
    assert os.environ.get("_ARGCOMPLETE") is None
