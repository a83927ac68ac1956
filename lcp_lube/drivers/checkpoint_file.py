"""The file of a checkpoint: a header, then arrays in the natural order, written and read by all ranks together.

A line of 64 bytes (format, length and checksum of what follows), a JSON object, and the arrays one behind the other as 8-byte
numbers, x fastest: the same on any number of ranks. A new file takes the old one's place when it is on disk as a whole, never
before.
"""

import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..base.parallel import Array
from ..base.together import on_all_ranks, reserve
from ..errors import InputError
from ..problems.grid import Grid

MAGIC, FORMAT = "lcp_lube checkpoint", 1


def write(path: Path, grid: Grid, header: dict[str, Any], arrays: list[tuple[str, Array]]) -> None:
    """Replace the file. Collective.

    Parameters
    ----------
    arrays : name and this rank's points.

    Raises
    ------
    InputError : on every rank, with the reason; what was there before is there still.
    """
    named = [(name, _checksum(grid, values)) for name, values in arrays]
    text = json.dumps({**header, "shape": grid.shape, "arrays": named}).encode()
    text += b" " * (-len(text) % 8) + b"\n" * 8  # the arrays begin at a multiple of 8
    text = grid.comm.bcast(text)  # seconds in it are each rank's own, and so would be the place where its arrays begin
    line = f"{MAGIC} {FORMAT} {len(text):12d} {zlib.crc32(text):08x}"
    head = line.encode().ljust(63) + b"\n" + text
    temporary, comm = path.with_name(f".{path.name}.new"), grid.comm
    try:
        with on_all_ranks(comm):
            if comm.rank == 0:
                temporary.write_bytes(head)
                reserve(str(temporary), len(head) + 8 * grid.size * len(arrays))
        with on_all_ranks(comm):
            _transfer(grid, temporary, len(head), [values for _, values in arrays], write=True)
        with on_all_ranks(comm):
            if comm.rank == 0:
                _settle(temporary, path)
    except InputError:
        if comm.rank == 0:
            temporary.unlink(missing_ok=True)
        raise


def read_header(path: Path, comm: MPI.Comm) -> tuple[dict[str, Any], int]:
    """The header, and where the arrays begin; the same on every rank. Collective.

    Raises
    ------
    InputError : no checkpoint, one that was cut short or damaged; on every rank, with the reason.
    """
    with on_all_ranks(comm, f"--resume {path}", (OSError, ValueError)):  # a ValueError: a name that no file can have
        found = _header_of(path) if comm.rank == 0 else None
    return comm.bcast(found)  # type: ignore[return-value]


def read_arrays(path: Path, grid: Grid, header: dict[str, Any], start: int) -> dict[str, Array]:
    """This rank's points of the arrays, on whatever ranks they were written. Collective.

    Raises
    ------
    InputError : they cannot be read, or are not what was written; on every rank, whichever could not.
    """
    arrays = [np.empty(grid.local_size) for _ in header["arrays"]]
    with on_all_ranks(grid.comm, f"--resume {path}"):
        _transfer(grid, path, start, arrays, write=False)
    for (name, checksum), values in zip(header["arrays"], arrays, strict=True):
        if _checksum(grid, values) != checksum:
            raise InputError(f"--resume {path}: damaged: {name} is not what was written")
    return {name: values for (name, _), values in zip(header["arrays"], arrays, strict=True)}


def _header_of(path: Path) -> tuple[dict[str, Any], int]:
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError("is no ordinary file")  # a pipe would be waited for
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


def _checksum(grid: Grid, values: Array) -> str:
    """A 64-bit sum over the points, the same on any number of ranks; any change of a single number changes it. Collective."""
    nx = grid.shape[0]
    column, line = np.arange(grid.x_start, grid.x_end, dtype=np.uint64), np.arange(grid.y_start, grid.y_end, dtype=np.uint64)
    odd = (np.uint64(2) * (line[:, None] * np.uint64(nx) + column) + np.uint64(1)).ravel()
    bits = np.ascontiguousarray(values).view(np.uint64)
    own = int(np.sum((bits ^ (bits >> np.uint64(29))) * odd, dtype=np.uint64))
    return f"{sum(grid.comm.allgather(own)) % 2**64:016x}"


def _transfer(grid: Grid, path: Path, start: int, arrays: list[Array], write: bool) -> None:
    """This rank's part of arrays that lie one behind the other in a file, in the natural order; raises OSError.

    Every rank has the file to itself: where one fails, no other waits for it inside MPI.
    """
    place = ((grid.shape[1] if grid.dim == 2 else 1), grid.shape[0]), grid.box, (grid.y_start, grid.x_start)
    box = MPI.DOUBLE.Create_subarray(*place).Commit()
    try:
        # Absolute: Open MPI 4 fails on a name without a folder.
        file = MPI.File.Open(MPI.COMM_SELF, str(path.absolute()), MPI.MODE_WRONLY if write else MPI.MODE_RDONLY)
        try:
            for k, values in enumerate(arrays):
                file.Set_view(start + 8 * k * grid.size, MPI.DOUBLE, box)
                (file.Write if write else file.Read)([np.ascontiguousarray(values), MPI.DOUBLE])
            if write:
                file.Sync()
        finally:
            file.Close()
    except MPI.Exception as error:
        raise OSError(error.Get_error_string()) from None
    finally:
        box.Free()


def _settle(temporary: Path, path: Path) -> None:
    """To the disk, then to its name, then that name to the disk."""
    for name, then in ((temporary, lambda: os.replace(temporary, path)), (path.parent, lambda: None)):
        descriptor = os.open(name, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        then()
