"""The one exception for bad input."""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """Bad input: its message is the one line a user sees; the command line then ends with exit status 2."""

    def __init__(self, message: str):
        super().__init__(" ".join(message.splitlines()))  # what was found may hold line ends


def nearest(word: str, legal: Iterable[str], dash: str = "") -> str:
    """'; nearest is X', or nothing when nothing is near."""
    close = difflib.get_close_matches(word, list(legal), n=1, cutoff=0.5)
    return f"; nearest is {dash}{close[0]}" if close else ""
