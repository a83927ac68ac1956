"""The exceptions: for bad input, and for numbers that were not found."""

from collections.abc import Iterable

LONGEST = 700  # characters: some six lines of a terminal; of a longer message both ends are kept, where file and value stand


class InputError(ValueError):
    """Bad input: its message is the one line a user sees; the command line then ends with exit status 2.

    What was found may hold line ends, control characters or a whole file: these are joined, escaped and cut.
    """

    def __init__(self, message: str):
        line = " ".join(message.splitlines())
        line = "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in line)
        super().__init__(line if len(line) <= LONGEST else f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}")


class NotFound(RuntimeError):
    """Numbers that no iteration found: an outcome, after which the command line ends with exit status 1."""


def nearest(word: str, legal: Iterable[str], dash: str = "") -> str:
    """'; nearest is X', or nothing when nothing is near; a difference in capitals alone is the least."""
    import difflib  # only where there is a mistake to explain

    names = list(legal)
    close = [name for name in names if name.lower() == word.lower()] or difflib.get_close_matches(word, names, 1, 0.5)
    if not close:
        folded = {name.lower(): name for name in names}
        close = [folded[name] for name in difflib.get_close_matches(word.lower(), folded, 1, 0.5)]
    return f"; nearest is {dash}{close[0]}" if close else ""
