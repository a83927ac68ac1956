"""Many answers as one animation of ParaView: a .pvd that names a .vts for each."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from mpi4py import MPI

from ..errors import InputError
from ..problems.solution import Solution
from . import files


def save_series(solutions: Mapping[float, Solution], path: str | Path, boundary: bool = False) -> None:
    """Write `path`, a .pvd, and beside it path_0000.vts, path_0001.vts ... Collective.

    Parameters
    ----------
    solutions : answers by what ParaView calls the time: seconds, or the value that was varied.
    boundary : with the points of the sides.

    Raises
    ------
    InputError : another extension, no solutions, a file that cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".pvd" or not solutions:
        raise InputError(f"{path}: a name that ends in .pvd, and one solution at least, are needed")
    entries = []
    for k, (time, solution) in enumerate(solutions.items()):
        name = f"{path.stem}_{k:04d}.vts"
        files.save(solution, path.with_name(name), boundary)
        entries.append((float(time), name))
    write_collection(path, entries, next(iter(solutions.values())).problem.grid.comm)


def write_collection(path: Path, entries: Sequence[tuple[float, str]], comm: MPI.Comm) -> None:
    """Write a .pvd of times and names of files beside it. Collective."""
    from xml.sax.saxutils import quoteattr  # here: it brings urllib along

    listed = "".join(f'    <DataSet timestep="{time!r}" part="0" file={quoteattr(name)}/>\n' for time, name in entries)
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n  <Collection>\n'
    files.write_text(path, f"{head}{listed}  </Collection>\n</VTKFile>\n", comm)
