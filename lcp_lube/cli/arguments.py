"""The command line's grammar (arguments.toml). Own options begin with two dashes; every single-dash option is PETSc's.

No PETSc here.
"""

import argparse
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

from .. import __version__
from ..base.quantity import in_si
from ..errors import InputError, nearest
from ..registry import STABILITY

GRAMMAR: dict[str, Any] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
KINDS: dict[str, dict[str, Any]] = {
    "flag": {"action": "store_true"},
    "yes-no": {"action": argparse.BooleanOptionalAction},
    "list": {"action": "append", "default": []},
    "words": {"nargs": "*"},
}


def number(text: str) -> float:
    """A number, 1e-4, .75 or 1%; its unit would have nothing to be checked against."""
    try:
        value = in_si(text, "")
        return float(text) if value is None else value  # nan and inf are for others to refuse
    except InputError as error:
        raise argparse.ArgumentTypeError(f"{text}: {error}") from None
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid float value: {text!r}") from None


def whole(text: str) -> int:
    """A whole number, 200 or 1e3."""
    try:
        return int(text)
    except ValueError:
        pass
    try:
        value = in_si(text, "")
    except InputError:
        value = None
    if value is None or not value.is_integer():
        raise argparse.ArgumentTypeError(f"invalid int value: {text!r}")
    return int(value)


TYPES = {"number": number, "whole": whole, "int": int, "path": Path}
# In texts of the grammar.
FILLED = {"maps": ", ".join(STABILITY), "lines": "; ".join(f"{name}, {entry.line}" for name, entry in STABILITY.items())}


class Parser(argparse.ArgumentParser):
    """argparse, but an error is an InputError: one line, with the nearest legal name."""

    def error(self, message: str) -> NoReturn:
        unknown = re.match(r"unrecognized arguments: (--\S+)", message)
        if unknown:
            option, below = unknown[1].partition("=")[0], [parser for parser in self.parsers() if parser is not self]
            having = [parser.prog.split()[-1] for parser in below if option in parser._option_string_actions]
            # Of this parser and of its commands: the error of an unknown option is raised at the top.
            names = [name for parser in self.parsers() for action in parser._actions for name in action.option_strings]
            near = f"; it is one of {', '.join(having)}" if having else nearest(option, names)
            message = f"{unknown[1]}: no such option{near}"
        wrong = re.match(r"argument (\S+): invalid choice: '(.*?)' \(choose from (.*)\)", message)
        if wrong:
            legal = [name.strip("' ") for name in wrong[3].split(",")]
            message = f"{wrong[1]} {wrong[2]}: allowed are {', '.join(legal)}{nearest(wrong[2], legal)}"
        raise InputError(message)

    def parsers(self) -> Iterator["Parser"]:
        """This one and those of its commands."""
        yield self
        for action in self._actions:
            for below in action.choices.values() if isinstance(action.choices, dict) else ():
                yield from below.parsers()


def parse(own: list[str]) -> argparse.Namespace:
    """The command and its options; `words`: what they were read from."""
    return parser_of_all().parse_args(own, argparse.Namespace(words=own))


def parser_of_all() -> Parser:
    """The grammar of every command."""
    parser = Parser(
        prog="lcp-lube",
        description="Cavitation in lubricated bearings as a complementarity problem, solved with PETSc.",
        epilog="Every single-dash option goes to PETSc (-ksp_type gmres -pc_type ilu -log_view); put them after SCENE. "
        "-help lists them.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"lcp-lube {__version__}")
    _add_commands(parser, "command", "COMMAND", GRAMMAR["command"])
    return parser


def _add_commands(parser: argparse.ArgumentParser, dest: str, metavar: str, commands: dict[str, Any]) -> None:
    """Commands, or those of a command, with their options."""
    below = parser.add_subparsers(dest=dest, required=True, metavar=metavar, parser_class=Parser)
    for name, command in commands.items():
        text = command["help"].format(**FILLED)
        example = f"example: {command['example']}" if "example" in command else None
        one = below.add_parser(name, help=text, description=text, epilog=example, allow_abbrev=False)
        shared = command.get("groups", ())
        for group in ("scene", "solver", "own", "quick", "json", "results"):
            options = command.get("options", {}) if group == "own" else GRAMMAR["group"][group] if group in shared else {}
            for option, said in options.items():
                _add_option(one, option, **said)
        if "command" in command:
            _add_commands(one, name, "|".join(command["command"]), command["command"])


def _add_option(parser: argparse.ArgumentParser, option: str, help: str = "", **more: Any) -> None:
    keywords = KINDS.get(more.pop("kind", ""), {}) | more
    if "type" in keywords:
        keywords["type"] = TYPES[keywords["type"]]
    if help:
        keywords["help"] = argparse.SUPPRESS if help == "hidden" else help.format(**FILLED)
    parser.add_argument(option, **keywords)
