"""Checkpoints of the coupling loop: what its films have made of the fields so far, from which it goes on as if not stopped.

Anderson's method is a function of the fields that it began with and of what the films have answered since. The file holds both,
and the last film's p and r, from which the next one starts: taken up again, the loop is given those answers instead of films
(`Loop.settle`), takes the same steps and comes to the same next film. Saved is after a film; `every` counts films.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.solution import Step
from ...scenes.effects.named import named
from .. import checkpoint_file
from ..ask import Ask, Start
from ..checkpoint import CHOICES, Checkpoint, Checkpointer, load, scene_record
from .loop import Loop

NUMBERS = ("solves", "work")


class CouplingFile:
    """Writes a loop's checkpoints on any of its grids, and takes one up. Every method is collective.

    Attributes
    ----------
    ask : what each film is asked: nothing of files, and as the run was begun.

    Raises
    ------
    InputError : a file that cannot be written, is none of this scene's coupling, or is damaged.
    """

    def __init__(self, scene: Any, ask: Ask):
        self.keeper = Checkpointer(ask.checkpoint, ask.every, ask.mpi)
        self.saved: Checkpoint | None = None
        if ask.resume is not None:
            self.saved = load(ask.resume, scene_record(scene), ask.mpi)
            if "effects" not in self.saved.record:
                raise InputError(f"--resume {ask.resume}: no checkpoint of a film with effects")
            ask = self.saved.settled(ask)
        self.keeper.begin(scene, tuple(getattr(ask, name) for name in CHOICES))
        self.keeper.record["effects"] = named(scene)
        self.ask = replace(ask, checkpoint=None, resume=None, every=1)

    def holds(self, loop: Loop) -> bool:
        """Whether the file to go on from was written on this loop's grid."""
        return self.saved is not None and self.saved.shape == loop.base.grid.shape

    def save(self, loop: Loop) -> None:
        """A film was solved; raises as `Checkpointer.after_step`."""
        self.keeper.after_step(lambda: self._write(loop))

    def _write(self, loop: Loop) -> None:
        parts = [("first", loop.begun), ("last", loop.last), *((f"made.{k}", one) for k, one in enumerate(loop.log))]
        arrays = [(f"{name}.{of}", a) for name, x in parts for of, a in zip(loop.names, loop.split(x), strict=True)]
        assert loop.solution is not None  # a film was solved
        arrays += [(f"fields.{name}", loop.solution.fields[name]) for name in "pr"]
        numbers = {name: getattr(loop, name) for name in NUMBERS}
        self.keeper.write(loop.base.grid, {"coupling": numbers}, arrays, loop.steps)

    def restore(self, loop: Loop) -> Array:
        """Give the loop what the file has; the fields that it began with.

        Raises
        ------
        InputError : a damaged file.
        """
        assert self.saved is not None  # as `holds` found
        grid, record = loop.base.grid, self.saved.record
        arrays = checkpoint_file.read_arrays(self.saved.path, grid, record, self.saved.start)

        def vector(name: str) -> Array:
            return np.concatenate([arrays[f"{name}.{of}"] for of in loop.names])

        for name in NUMBERS:
            setattr(loop, name, record["coupling"][name])
        loop.solves = 0  # counted again, as the answers are taken from the file
        loop.steps = [Step(*step) for step in record["steps"]]
        made = sum(name.startswith("made.") and name.endswith(f".{loop.names[0]}") for name in arrays)
        loop.given = [vector(f"made.{k}") for k in range(made)]
        near = replace(loop.frozen, by=loop.by(loop.cells(vector("last")))).build(grid.petsc_comm)
        loop.start = Start(near, {name: arrays[f"fields.{name}"] for name in "pr"})
        return vector("first")
