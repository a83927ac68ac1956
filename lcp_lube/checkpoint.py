"""Checkpoints: a run's iterate in one file, from which the run goes on as if it had not been stopped.

The file holds a line of text (format, length and checksum of what follows), a JSON object (scene, method, options, the grid
reached and the steps so far) and then the arrays of the method's state (`Method.state`) as 8-byte numbers in the natural order
of the grid, x fastest. All ranks write and read their own part, so any other number of ranks can go on with it. A new
checkpoint takes the old one's place when it is on disk as a whole, never before.
"""

import json
import os
import signal
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from . import __version__
from .errors import InputError
from .parallel import Array
from .problems.grid import Grid
from .problems.solution import Fields, Outcome, Step
from .scene import Scene
from .solvers.newton import Method, Monitor, Stopping, iterate

MAGIC, FORMAT = "lcp_lube checkpoint", 1
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

    found: list[Entry] = []
    for name in names:
        value = owner
        for part in name.split("."):
            value = getattr(value, part)
        found += walk(name, value)
    return found


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
    InputError : every < 1, or the file cannot be written.
    """

    def __init__(self, path: str | Path | None, every: int = 1, comm: MPI.Comm = MPI.COMM_WORLD):
        self.active, self.path, self.every, self.comm = path is not None, Path(path or ""), every, comm
        if every < 1:
            raise InputError(f"--every {every}: at least 1 is needed")
        if self.active and (reason := comm.bcast(_not_writable(self.path) if comm.rank == 0 else None)):
            raise InputError(f"--checkpoint {path}: {reason}")
        self.record: dict[str, Any] = {}
        self.steps: list[Step] = []
        self._run: Method | None = None
        self._reached: Fields = {}
        self._grid: Grid | None = None
        self._since = 0
        self._saved = False
        self._signal = 0

    def begin(self, scene: Scene, choices: tuple[Any, ...]) -> None:
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
        with self._listening():
            return iterate(run, stopping, self._watching(monitor), before)

    def _watching(self, monitor: Monitor | None) -> Monitor:
        """The monitor, and after it the checkpoints that are due, and one when the run is told to end."""

        def watch(k: int, step: Step) -> None:
            if monitor is not None:
                monitor(k, step)
            self.steps.append(step)
            self._since += 1
            told = self.comm.allreduce(self._signal, MPI.MAX)
            if told or self._since >= self.every:
                self.save()
            if told == signal.SIGTERM:
                raise SystemExit(128 + told)
            if told:
                raise KeyboardInterrupt(f"--resume {self.path} goes on")

        return watch

    @contextmanager
    def _listening(self) -> Iterator[None]:
        """SIGINT, and SIGTERM as batch systems send it ahead of time, let the step end and be saved; a second one does not."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def note(number: int, _: Any) -> None:
            if self._signal:
                raise KeyboardInterrupt
            self._signal = number

        before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def save(self) -> None:
        """Write the file.

        Raises
        ------
        InputError : it cannot be written; the last checkpoint is still there then.
        """
        assert self._run is not None and self._grid is not None
        leaves = [*_leaves(self._run, state_names(self._run)), *self._reached.items()]
        arrays = [(name, np.asarray(value, dtype=float)) for name, value in leaves if isinstance(value, np.ndarray)]
        scalars = {name: _plain(value) for name, value in leaves if not isinstance(value, np.ndarray)}
        header = {
            **self.record,
            "version": __version__,
            "shape": self._grid.shape,
            "steps": [astuple(step) for step in self.steps],
            "scalars": scalars,
            "arrays": [(name, _checksum(self._grid, values)) for name, values in arrays],
        }
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 8) + b"\n" * 8  # the arrays begin at a multiple of 8
        line = f"{MAGIC} {FORMAT} {len(text):12d} {zlib.crc32(text):08x}"
        head = line.encode().ljust(63) + b"\n" + text
        temporary = self.path.with_name(f".{self.path.name}.new")
        try:
            self._on_rank_0(lambda: _reserve(temporary, head, 8 * self._grid.size * len(arrays)))  # type: ignore[union-attr]
            failed = ""
            try:
                _transfer(self._grid, temporary, len(head), [values for _, values in arrays], write=True)
            except MPI.Exception as error:
                failed = error.Get_error_string()
            if failed := max(self.comm.allgather(failed)):
                raise InputError(f"--checkpoint {self.path}: {failed}")
            self._on_rank_0(lambda: _settle(temporary, self.path))
        except InputError:
            if self.comm.rank == 0:
                temporary.unlink(missing_ok=True)
            raise
        self._since, self._saved = 0, True

    def _on_rank_0(self, call: Callable[[], None]) -> None:
        reason = ""
        if self.comm.rank == 0:
            try:
                call()
            except OSError as error:
                reason = error.strerror or str(error)
        if reason := self.comm.bcast(reason):
            kept = "; the last one is still there" if self._saved else ""
            raise InputError(f"--checkpoint {self.path}: could not be written: {reason}{kept}")


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
        arrays = [np.empty(grid.local_size) for _ in names]
        try:
            _transfer(grid, self.path, self.start, arrays, write=False)
        except MPI.Exception as error:
            raise InputError(f"--resume {self.path}: {error.Get_error_string()}") from None
        for (name, checksum), array in zip(self.record["arrays"], arrays, strict=True):
            if _checksum(grid, array) != checksum:
                raise InputError(f"--resume {self.path}: damaged: {name} is not what was written")
        values = {**self.record["scalars"], **dict(zip(names, arrays, strict=True))}
        for name in state_names(run):
            *path, last = name.split(".")
            owner: Any = run
            for part in path:
                owner = getattr(owner, part)
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
        """How the methods ended whose fallback was running."""
        failed = self.record["failed"]
        return [(Outcome(outcome), message, [Step(*step) for step in steps]) for outcome, message, steps in failed]

    def settle(self, **given: Any) -> dict[str, Any]:
        """How the run was begun, for what is not given anew: None, 'auto' or nothing.

        Raises
        ------
        InputError : something else is given than the run was begun with.
        """
        for name in CHOICES:
            kept = self.record[name]
            if given[name] in (None, "auto") or given[name] == {}:
                given[name] = kept if kept != "" else given[name]  # a method without a system
            elif name != "recipe" and json.loads(json.dumps(given[name])) != kept:  # another inner solver may go on
                raise InputError(f"--resume {self.path}: the run was begun with {name} {kept}, not {given[name]}")
        return given


def load(path: str | Path, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> Checkpoint:
    """Read a checkpoint of this scene. Collective.

    Raises
    ------
    InputError : no checkpoint, one of another scene, of another version, cut short or damaged.
    """
    path, reason, start = Path(path), "", 0
    header: dict[str, Any] = {}
    if comm.rank == 0:
        try:
            if path.exists() and not (path.is_file() or path.is_dir()):
                raise InputError("is no ordinary file")
            header, start = _read_header(path)
        except OSError as error:
            reason = error.strerror or str(error)
        except ValueError as error:  # InputError, or a name that no file can have
            reason = str(error)
    reason, header, start = comm.bcast((reason, header, start))
    if not reason and header["version"] != __version__:
        reason = f"written by lcp_lube {header['version']}, this is {__version__}"
    if not reason:
        reason = _other_scene(header["scene"], scene_record(scene))
    if reason:
        raise InputError(f"--resume {path}: {reason}")
    return Checkpoint(path, header, tuple(header["shape"]), [Step(*step) for step in header["steps"]], start)


def scene_record(scene: Scene) -> dict[str, Any]:
    """A scene's data as JSON holds them."""
    return json.loads(json.dumps({"class": type(scene).__name__, **scene.model_dump(mode="json")}, default=str))


def _other_scene(old: dict[str, Any], new: dict[str, Any]) -> str:
    changed = [key for key in {**old, **new} if key != "name" and old.get(key) != new.get(key)]
    if not changed:
        return ""
    key = changed[0]
    return f"a checkpoint of another scene: its {key} is {old.get(key)}, here it is {new.get(key)}"


def _read_header(path: Path) -> tuple[dict[str, Any], int]:
    with path.open("rb") as file:
        line = file.read(64)
        words = line.decode("ascii", errors="replace").split()
        if " ".join(words[:2]) != MAGIC:
            raise InputError("no checkpoint of lcp_lube")
        if words[2:3] != [str(FORMAT)]:
            raise InputError(f"a checkpoint of format {' '.join(words[2:3])}, this version reads {FORMAT}")
        try:
            length, crc = int(words[3]), int(words[4], 16)
        except (IndexError, ValueError):
            raise InputError("damaged: its first line cannot be read") from None
        size = os.fstat(file.fileno()).st_size
        if size < 64 + length:
            raise InputError(f"cut short: {size} bytes, its header alone takes {64 + length}")
        text = file.read(length)
        if zlib.crc32(text) != crc:
            raise InputError("damaged: its header is not what was written")
        header = json.loads(text)
        expected = 64 + length + 8 * int(np.prod(header["shape"])) * len(header["arrays"])
        if size != expected:
            raise InputError(f"{'cut short' if size < expected else 'damaged'}: {size} bytes where {expected} were written")
    return header, 64 + length


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _checksum(grid: Grid, values: Array) -> str:
    """A 64-bit sum over the points, the same on any number of ranks; any change of a single number changes it. Collective."""
    nx = grid.shape[0]
    column, line = np.arange(grid.x_start, grid.x_end, dtype=np.uint64), np.arange(grid.y_start, grid.y_end, dtype=np.uint64)
    odd = (np.uint64(2) * (line[:, None] * np.uint64(nx) + column) + np.uint64(1)).ravel()
    bits = np.ascontiguousarray(values).view(np.uint64)
    own = int(np.sum((bits ^ (bits >> np.uint64(29))) * odd, dtype=np.uint64))
    return f"{sum(grid.comm.allgather(own)) % 2**64:016x}"


def _transfer(grid: Grid, path: Path, start: int, arrays: list[Array], write: bool) -> None:
    """This rank's part of arrays that lie one behind the other in a file, in the natural order. Collective."""
    place = ((grid.shape[1] if grid.dim == 2 else 1), grid.shape[0]), grid.box, (grid.y_start, grid.x_start)
    box = MPI.DOUBLE.Create_subarray(*place).Commit()
    # Absolute: Open MPI 4 fails on a name without a folder.
    file = MPI.File.Open(grid.comm, str(path.absolute()), MPI.MODE_WRONLY if write else MPI.MODE_RDONLY)
    try:
        for k, values in enumerate(arrays):
            file.Set_view(start + 8 * k * grid.size, MPI.DOUBLE, box)
            (file.Write_all if write else file.Read_all)([np.ascontiguousarray(values), MPI.DOUBLE])
        if write:
            file.Sync()
    finally:
        file.Close()
        box.Free()


def _reserve(temporary: Path, head: bytes, rest: int) -> None:
    """The file with its header and room for the arrays: a full disk shows here."""
    with temporary.open("wb") as file:
        file.write(head)
        file.flush()
        if rest:
            os.posix_fallocate(file.fileno(), len(head), rest)


def _settle(temporary: Path, path: Path) -> None:
    """To the disk, then to its name, then that name to the disk."""
    for name, then in ((temporary, lambda: os.replace(temporary, path)), (path.parent, lambda: None)):
        descriptor = os.open(name, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        then()


def _not_writable(path: Path) -> str:
    try:
        if path.is_dir():
            return "is a folder"
        if path.exists() and not path.is_file():
            return "is no ordinary file"  # a device would be replaced
        if not path.parent.is_dir():
            return f"folder {path.parent} does not exist"
        probe = path.with_name(f".{path.name}.new")
        probe.touch()
        probe.unlink()
    except OSError as error:
        return f"cannot be written in {path.parent}: {error.strerror}"
    except ValueError as error:
        return str(error)  # a name that no file can have
    return ""
