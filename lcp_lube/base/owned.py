"""Freeing PETSc objects: a list of them for each Python object that they were made for, freed in a fixed order."""

import weakref
from functools import cached_property
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
        self._owner, self.names = weakref.ref(owner), set[str]()  # names: of `made` attributes
        self._unwatched = comm.getSize() == 1

    def __call__(self, made: Made) -> Made:
        if self._unwatched and (owner := self._owner()) is not None:  # many never make anything
            weakref.finalize(owner, _free, self._made).atexit = False  # PETSc ends before the interpreter does
            self._unwatched = False
        self._made.append(made)
        return made

    def free(self) -> None:
        """Free all of them; a second time does nothing. Those that are `made` come again at their next use. Collective."""
        _free(self._made)
        if (owner := self._owner()) is not None:
            for name in self.names:
                owner.__dict__.pop(name, None)


class made(cached_property):
    """A PETSc object (or a tuple) of an owner with an `Owned` in `_own`: made at first use, and again once it was freed.

    What is asked of a solution after its PETSc objects were freed works by that: to use a freed one ends the process.
    """

    def __get__(self, owner: Any, kind: Any = None) -> Any:  # type: ignore[override]
        if owner is None:
            return self
        value = super().__get__(owner, kind)
        for one in value if isinstance(value, tuple) else (value,):
            owner._own(one)
        owner._own.names.add(self.attrname)
        return value


def collect(comm: PETSc.Comm) -> None:
    """Free what all ranks have dropped; one rank does so at once. Collective."""
    if comm.getSize() > 1 and hasattr(PETSc, "garbage_cleanup"):
        PETSc.garbage_cleanup(comm)


def _free(made: list[Any]) -> None:
    if not PETSc.Sys.isInitialized() or PETSc.Sys.isFinalized():
        made.clear()
    while made:
        made.pop().destroy()
