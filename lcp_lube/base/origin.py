"""Which code made a stored row, so that what older code found is never printed as if new."""

from datetime import date
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from petsc4py import PETSc

from .. import __version__

PACKAGE = Path(__file__).parents[1]
COVERED = ("**/*.py", "**/*.toml", "**/*.opts", "../options/*.opts")  # programs, scenes, recipes (in a checkout outside)
COLUMNS = ("version", "date", "digest")


@lru_cache(maxsize=1)
def code() -> str:
    """The package's version and a hash of all that its runs are made by: sources, scenes, recipes, PETSc's release.

    Any change of these files makes it another one, also a change of comments: what does not matter to a run cannot be told
    from what does.
    """
    digest = sha256(repr(PETSc.Sys.getVersion()).encode())
    for path in sorted({path.resolve() for pattern in COVERED for path in PACKAGE.glob(pattern)}):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{__version__}+{digest.hexdigest()[:8]}"


def signature(key: list[str]) -> dict[str, str]:
    """COLUMNS for a row that is made now: `code`, the date, and a digest of the code and of the row's key, its command say."""
    digest = sha256("\0".join([code(), *key]).encode()).hexdigest()[:12]
    return {"version": code(), "date": date.today().isoformat(), "digest": digest}


def told(row: dict[str, str]) -> str:
    """By what and when a stored row was made, in words."""
    return f"stored by version {row.get('version') or 'unknown'}, {row.get('date') or 'date unknown'}"
