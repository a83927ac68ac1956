"""Completion of words in a shell, by argcomplete: eval "$(register-python-argcomplete lcp-lube)"."""

from collections.abc import Callable

from ..registry import METHODS, STABILITY, SYSTEMS, recipe_names, scene_names
from .arguments import Parser

# What an argument may be, by its name in the namespace.
NAMES: dict[str, Callable[[], list[str]]] = {
    "scene": scene_names,
    "scenes": scene_names,
    "source": scene_names,
    "method": lambda: ["auto", *METHODS],
    "methods": lambda: [*METHODS],
    "system": lambda: ["auto", *SYSTEMS],
    "recipe": recipe_names,
    "recipes": recipe_names,
    "maps": lambda: [*STABILITY],
}


def complete(parser: Parser) -> None:
    """Answer the shell and end the process; return at once where argcomplete is missing."""
    try:
        import argcomplete
        from argcomplete.completers import FilesCompleter
    except ImportError:
        return
    files = FilesCompleter(allowednames=("toml",))

    def named(dest: str) -> Callable[..., list[str]]:
        def words(prefix: str, **_: object) -> list[str]:
            head, comma, last = prefix.rpartition(",") if dest in ("methods", "recipes") else ("", "", prefix)
            found = [f"{head}{comma}{name}" for name in NAMES[dest]() if name.startswith(last)]
            return [*found, *files(prefix)] if dest in ("scene", "source") else found

        return words

    for inner in parser.parsers():
        for action in inner._actions:
            if action.dest in NAMES:
                action.completer = named(action.dest)  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options="long")
