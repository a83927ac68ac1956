"""Who frees PETSc objects: a list of them for the Python object that they were made for, freed in a fixed order."""

import weakref
from typing import Any, TypeVar

from petsc4py import PETSc

Made = TypeVar("Made")


class Owned:
    """PETSc objects made for one Python object: ``self.mat = own(PETSc.Mat()...)``. The last one made is freed first.

    `free` is collective. An owner that is dropped without it has them freed at once on one rank; on several, ranks drop it at
    different times, and PETSc frees together what all of them have dropped when `collect` is called next.

    Parameters
    ----------
    owner : the object that goes with them; none of them may refer to it.
    comm : the ranks that share them.
    """

    def __init__(self, owner: object, comm: PETSc.Comm):
        self._made: list[Any] = []
        if comm.getSize() == 1:
            weakref.finalize(owner, _free, self._made).atexit = False  # PETSc ends before the interpreter does

    def __call__(self, made: Made) -> Made:
        self._made.append(made)
        return made

    def free(self) -> None:
        """Free all of them; a second time does nothing. Collective."""
        _free(self._made)


def collect(comm: PETSc.Comm) -> None:
    """Free what all ranks have dropped. Collective."""
    if hasattr(PETSc, "garbage_cleanup"):
        PETSc.garbage_cleanup(comm)


def _free(made: list[Any]) -> None:
    if not PETSc.Sys.isInitialized() or PETSc.Sys.isFinalized():
        made.clear()
    while made:
        made.pop().destroy()
