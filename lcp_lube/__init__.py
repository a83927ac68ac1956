"""Cavitation in lubricated bearings as a complementarity problem, solved with PETSc.

Importing this package starts neither PETSc nor MPI: a program may still call
``petsc4py.init(argv)`` first, which is a silent no-op once PETSc runs.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "Ask": "lcp_lube.drivers.ask",
    "Complementarity": "lcp_lube.scenes.user",
    "InputError": "lcp_lube.errors",
    "Scene": "lcp_lube.scenes.scene",
    "load_scene": "lcp_lube.scenes.scene",
    "solve": "lcp_lube.api",
    "Solution": "lcp_lube.problems.solution",
    "save_series": "lcp_lube.output.files",
    "to_pandas": "lcp_lube.output.rows",
}
__all__ = [*_PUBLIC, "__version__"]


_GONE = {"solve_to_accuracy": "solve(scene, accuracy=TOL)", "solve_or_balance": "solve(scene)"}


def __getattr__(name: str) -> Any:
    if name in _GONE:
        raise AttributeError(f"lcp_lube.{name} is now {_GONE[name]}")
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
