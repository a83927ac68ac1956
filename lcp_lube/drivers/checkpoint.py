"""Checkpoints: a run's iterate in one file (`checkpoint_file`), from which it goes on as if it had not been stopped.

Saved are the attributes that a method's step starts from (`Method.state`), the scene, the choices that were made, the grid that
was reached and the steps so far. On as many ranks as before the run takes the same steps; any other number can go on with it.
"""

import json
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields, is_dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from .. import __version__
from ..base.files import not_writable
from ..base.parallel import Array
from ..errors import InputError
from ..problems.grid import Grid
from ..problems.solution import Fields, Outcome, Step
from ..scenes.scene import Derived, Scene, Solvable
from ..solvers.method import Method
from ..solvers.newton import Monitor, Stopping, iterate
from . import checkpoint_file

# What a run is made of, apart from its scene: the same on every resume.
CHOICES = ("method", "system", "recipe", "nested", "options")
Entry = tuple[str, Any]


def _leaves(owner: Any, names: tuple[str, ...]) -> list[Entry]:
    """The arrays and numbers behind dotted attribute names, those inside tuples and dataclasses one by one."""

    def walk(name: str, value: Any) -> Iterator[Entry]:
        if isinstance(value, tuple):
            for k, part in enumerate(value):
                yield from walk(f"{name}.{k}", part)
        elif is_dataclass(value):
            for part in fields(value):
                yield from walk(f"{name}.{part.name}", getattr(value, part.name))
        else:
            yield name, value

    return [leaf for name in names for leaf in walk(name, attrgetter(name)(owner))]


def _rebuilt(name: str, old: Any, values: dict[str, Any]) -> Any:
    """The value of an attribute like `old`, from its leaves."""
    if isinstance(old, tuple):
        return tuple(_rebuilt(f"{name}.{k}", part, values) for k, part in enumerate(old))
    if is_dataclass(old) and not isinstance(old, type):
        return replace(
            old, **{part.name: _rebuilt(f"{name}.{part.name}", getattr(old, part.name), values) for part in fields(old)}
        )
    new = values[name]
    return new.astype(old.dtype) if isinstance(old, np.ndarray) else new


def state_names(method: Method) -> tuple[str, ...]:
    """Names of the attributes that the method, and the system that it uses, cannot do without.

    Raises
    ------
    InputError : the method does not say (`state`): it cannot be taken up again.
    """
    own = getattr(method, "state", ())
    if not own:
        raise InputError(f"--checkpoint: a run of {type(method).__name__} cannot be taken up again; choose another --method")
    return (*own, *(f"system.{name}" for name in getattr(getattr(method, "system", None), "state", ())))


class Checkpointer:
    """Runs the outer loop and writes checkpoints of it; `api.solve` tells it where the run is. Every method is collective.

    Parameters
    ----------
    path : the file; None: no checkpoints, the loop alone.
    every : steps between two checkpoints, over all grids of a nested run.
    comm : all ranks of the run.

    Raises
    ------
    InputError : the file cannot be written.
    """

    def __init__(self, path: str | Path | None, every: int = 1, comm: MPI.Comm = MPI.COMM_WORLD):
        self.active, self.path, self.every, self.comm = path is not None, Path(path or ""), every, comm
        if self.active and (reason := comm.bcast(not_writable(self.path) if comm.rank == 0 else None)):
            raise InputError(f"--checkpoint {path}: {reason}")
        self.record: dict[str, Any] = {}
        self.steps: list[Step] = []
        self._run: Method | None = None
        self._reached: Fields = {}
        self._grid: Grid | None = None
        self._since = 0
        self._saved = False
        self.told = 0

    def begin(self, scene: Solvable, choices: tuple[Any, ...]) -> None:
        """What is solved and how: the values of CHOICES."""
        if self.active:
            self.record = {"scene": scene_record(scene), **dict(zip(CHOICES, choices, strict=True)), "failed": []}

    def iterate(
        self,
        run: Method,
        grid: Grid,
        stopping: Stopping,
        monitor: Monitor | None,
        before: list[Step],
        reached: Fields | None = None,
        **record: Any,
    ) -> tuple[Outcome, str, list[Step]]:
        """`newton.iterate`, with checkpoints.

        Parameters
        ----------
        reached : fields that they are to hold too: those of a method that failed, where the next one may start.
        record : what they are to say of the run from here on.

        Raises
        ------
        InputError : the method cannot be taken up again, or a checkpoint cannot be written.
        KeyboardInterrupt, SystemExit : SIGINT or SIGTERM came, and the step that it met is saved.
        """
        if not self.active:
            return iterate(run, stopping, monitor, before)
        state_names(run)
        self._run, self._grid, self.steps = run, grid, list(before)
        self._reached = {f"reached.{name}": values for name, values in (reached or {}).items()}
        self.record |= record

        def watch(k: int, step: Step) -> None:
            if monitor is not None:
                monitor(k, step)
            self.steps.append(step)
            self.after_step(self.save)

        with self.listening():
            return iterate(run, stopping, watch, before)

    def after_step(self, save: Callable[[], None], last: bool = False) -> None:
        """Save if it is the last step, if that is due, or if the run is told to end; nothing without a file.

        Raises
        ------
        KeyboardInterrupt, SystemExit : SIGINT or SIGTERM came. And what `write` raises.
        """
        if not self.active:
            return
        self._since += 1
        told = self.comm.allreduce(self.told, MPI.MAX)
        if told or last or self._since >= self.every:
            save()
            self._since = 0
        if told == signal.SIGTERM:
            raise SystemExit(128 + told)
        if told:
            raise KeyboardInterrupt(f"--resume {self.path} goes on")

    @contextmanager
    def listening(self) -> Iterator[None]:
        """SIGINT and SIGTERM let the step end and be saved, if there is a file; a second one ends all."""
        if not self.active or threading.current_thread() is not threading.main_thread():
            yield
            return

        def note(number: int, _: Any) -> None:
            if self.told:
                raise KeyboardInterrupt
            self.told = number

        before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def save(self) -> None:
        """Write the run's file; raises as `write`."""
        assert self._run is not None and self._grid is not None
        leaves = [*_leaves(self._run, state_names(self._run)), *self._reached.items()]
        arrays = [(name, np.asarray(value, dtype=float)) for name, value in leaves if isinstance(value, np.ndarray)]
        numbers = [(name, value) for name, value in leaves if not isinstance(value, np.ndarray)]
        scalars = {name: value.item() if isinstance(value, np.generic) else value for name, value in numbers}
        self.write(self._grid, {"scalars": scalars}, arrays, self.steps)

    def write(self, grid: Grid, more: dict[str, Any], arrays: list[tuple[str, Array]], steps: list[Step]) -> None:
        """Write a file with these numbers and arrays.

        Raises
        ------
        InputError : it cannot be written; the last checkpoint is still there then.
        """
        header = {**self.record, "version": __version__, "steps": [astuple(step) for step in steps], **more}
        try:
            checkpoint_file.write(self.path, grid, header, arrays)
        except InputError as error:
            kept = "; the last one is still there" if self._saved else ""
            raise InputError(f"--checkpoint {self.path}: could not be written: {error}{kept}") from None
        self._saved = True


@dataclass(frozen=True)
class Checkpoint:
    """What a file holds: `record` as it was given to the `Checkpointer`, the grid, the steps; the state stays in the file."""

    path: Path
    record: dict[str, Any]
    shape: tuple[int, ...]
    steps: list[Step]
    start: int

    def restore(self, run: Method, grid: Grid, reached: Fields | None = None) -> list[Step]:
        """Put the saved state into a run made anew, and fields into `reached`; returns the steps that it had taken. Collective.

        Raises
        ------
        InputError : the state is another method's, or damaged.
        """
        names = [name for name, _ in self.record["arrays"]]
        old = [*_leaves(run, state_names(run)), *((f"reached.{name}", values) for name, values in (reached or {}).items())]
        expected = [name for name, value in old if isinstance(value, np.ndarray)]
        if names != expected or {name for name, _ in old} != {*names, *self.record["scalars"]}:
            raise InputError(f"--resume {self.path}: not the state of {type(run).__name__} on this system")
        values = {**self.record["scalars"], **checkpoint_file.read_arrays(self.path, grid, self.record, self.start)}
        for name in state_names(run):
            path, _, last = name.rpartition(".")
            owner = attrgetter(path)(run) if path else run
            setattr(owner, last, _rebuilt(name, getattr(owner, last), values))
        for name in reached or {}:
            reached[name] = values[f"reached.{name}"]  # type: ignore[index]
        return list(self.steps)

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """The grids from the one that was reached to the finest."""
        return [tuple(shape) for shape in self.record["shapes"]]

    @property
    def failures(self) -> list[tuple[Outcome, str, list[Step]]]:
        """How the methods ended that had failed before the one that was running."""
        failed = self.record["failed"]
        return [(Outcome(outcome), message, [Step(*step) for step in steps]) for outcome, message, steps in failed]

    def settled(self, ask: Any) -> Any:
        """The ask, with the choices that the run was begun with where it makes none: None, 'auto' or nothing.

        Raises
        ------
        InputError : something else is given than the run was begun with.
        """
        given = {name: getattr(ask, name) for name in CHOICES}
        for name in CHOICES:
            kept = self.record[name]
            if given[name] in (None, "auto") or given[name] == {}:
                given[name] = kept if kept != "" else given[name]  # a method without a system
            elif name != "recipe" and json.loads(json.dumps(given[name])) != kept:  # another inner solver may go on
                raise InputError(f"--resume {self.path}: the run was begun with {name} {kept}, not {given[name]}")
        return replace(ask, **given)


def load(path: str | Path, new: dict[str, Any], comm: MPI.Comm = MPI.COMM_WORLD) -> Checkpoint:
    """Read a checkpoint of the scene with this `scene_record`. Collective.

    Raises
    ------
    InputError : no checkpoint, one of another scene, of another version, cut short or damaged.
    """
    path = Path(path)
    header, start = checkpoint_file.read_header(path, comm)
    if header["version"] != __version__:
        raise InputError(f"--resume {path}: written by lcp_lube {header['version']}, this is {__version__}")
    old = header["scene"]
    if changed := [key for key in {**old, **new} if key != "name" and old.get(key) != new.get(key)]:
        differs = f"its {changed[0]} is {old.get(changed[0])}, here it is {new.get(changed[0])}"
        raise InputError(f"--resume {path}: a checkpoint of another scene: {differs}")
    return Checkpoint(path, header, tuple(header["shape"]), [Step(*step) for step in header["steps"]], start)


def scene_record(scene: Solvable) -> dict[str, Any]:
    """A scene's data as JSON holds them; of what a driver made of one, those of that."""
    while isinstance(scene, Derived):
        scene = scene.whole
    assert isinstance(scene, Scene)  # `compose` lets no other be checkpointed
    return json.loads(json.dumps({"class": type(scene).__name__, **scene.model_dump(mode="json")}, default=str))
