"""Fields in files: NumPy (.npz), NetCDF (.nc), ParaView (.vts, .vtr, .pvd), HDF5 (.h5). SI units throughout."""

import ctypes
import json
import zipfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..base.files import not_writable, replacing, write_text
from ..base.parallel import Array
from ..base.together import on_all_ranks, reserve
from ..errors import InputError, nearest
from ..problems.frame import Frame
from ..problems.grid import Grid
from ..problems.solution import Solution
from .results import as_dict, finite

FIELD_FILES = (".npz", ".nc", ".vts", ".vtr", ".pvd", ".h5")
PETSC_STRING = 13  # of PETSc's PetscDataType
MOST_TEXT = 60_000  # of an attribute: HDF5 takes 64 KB
PICTURES = (".png", ".pdf", ".svg")


def check_target(path: str | Path, plot: bool = False, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
    """Refuse, before a long run, a file that could not be written after it. Collective.

    Parameters
    ----------
    path : the file; its extension chooses the format.
    plot : a picture (`PICTURES`), else fields (`FIELD_FILES`).

    Raises
    ------
    InputError : an extension off the list, a folder that is missing or cannot be written to, a format whose library is
        missing. Rank 0 looks, all ranks raise.
    """
    if fault := comm.bcast(_fault(Path(path), plot) if comm.rank == 0 else None):
        raise InputError(f"{'--plot' if plot else '--output'} {path}: {fault}")


def save(
    solution: Solution, path: str | Path, boundary: bool = False, more: Mapping[str, tuple[Array, str]] | None = None
) -> None:
    """Write the fields of `Problem.physical` at the interior points, or with those of the sides. Collective.

    All in SI: for a lubrication problem p in Pa (absolute), r (void fraction), h in m; coordinates x, y in m. Arrays have
    shape (ny, nx), or (nx,) in 1D, in the natural order, whatever the number of ranks.

    - .npz: the fields, x of shape (nx,), y of shape (ny,) in 2D, and two JSON strings: `units` by field, and `result`, the
      object that --json prints; of plane films `fronts`, rows (number of the curve, x, y). Rank 0 gathers it all: take .h5 or
      .vts where that is too much for it.
    - .nc: NetCDF with the names and units of the CF conventions, the numbers of the answer among them, for xarray and many
      others; by rank 0 too.
    - .pvd: a collection of ParaView's of this one answer, with its .vts beside it; `save_series` writes one of many.
    - .vts, .vtr: ParaView's structured and rectilinear grid by PETSc's viewer; rank 0 writes, one rank's part at a time.
    - .h5: the fields, x and y as datasets by PETSc's viewer, all ranks writing, each with an attribute `units`; `Vec.load`
      with the field's name reads one back on any number of ranks. The file has the attribute
      `result`, as .npz, where that is less than 60 KB.

    Parameters
    ----------
    boundary : with the points of the sides: nx + 2 in x, ny + 2 in y (`Solution.field`).
    more : other fields at the interior points, and their units, by name.

    Raises
    ------
    InputError : the file cannot be written; then nothing is left behind. No sides.
    """
    path, grid = Path(path), solution.problem.grid
    suffix = path.suffix.lower()
    if wrong := _wrong_extension(suffix, plot=False):
        raise InputError(f"{path}: {wrong}")
    points = Frame(grid) if boundary else grid
    more = more or {}
    units = {**solution.units, **{name: unit for name, (_, unit) in more.items()}}
    fields = {name: solution.field(name, boundary) for name in solution.problem.physical(solution.fields)}
    fields |= {name: values for name, (values, _) in more.items()}
    if suffix == ".pvd":
        save_series({0.0: solution}, path, boundary)
        return
    with replacing(path, grid.comm) as temporary:
        if suffix == ".npz":
            _save_npz(solution, points, fields, units, temporary)
        elif suffix == ".nc":
            whole = {name: gather(points, values) for name, values in fields.items()}
            if grid.comm.rank == 0:
                from .netcdf import write_netcdf

                write_netcdf(solution, dict(zip("xy", coordinates(points), strict=False)), whole, temporary)
        else:
            result = ""
            if suffix == ".h5":  # a rank that fails inside HDF5 leaves the others there
                with on_all_ranks(grid.comm, f"{path}: could not be written"):
                    reserve(temporary, 8 * grid.size * len(fields))
                result = grid.comm.bcast(json.dumps(finite(as_dict(solution))))  # each rank has seconds of its own
            _save_by_viewer(points, fields, units, temporary, result)


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
        save(solution, path.with_name(name), boundary)
        entries.append((float(time), name))
    write_collection(path, entries, next(iter(solutions.values())).problem.grid.comm)


def write_collection(path: Path, entries: Sequence[tuple[float, str]], comm: MPI.Comm) -> None:
    """Write a .pvd of times and names of files beside it. Collective."""
    from xml.sax.saxutils import quoteattr  # here: it brings urllib along

    listed = "".join(f'    <DataSet timestep="{time!r}" part="0" file={quoteattr(name)}/>\n' for time, name in entries)
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n  <Collection>\n'
    write_text(path, f"{head}{listed}  </Collection>\n</VTKFile>\n", comm)


def gather(grid: Grid | Frame, values: Array, stride: tuple[int, int] = (1, 1)) -> Array:
    """A field on rank 0, or every stride-th point of it in x and in y; empty on the other ranks. Collective.

    Parameters
    ----------
    values : owned points, in the grid's order.
    stride : steps in x and y; the points taken are `taken(n, step)` in each direction.

    Returns
    -------
    Array of shape (ny, nx) or, in 1D, (nx,), counted after the strides.
    """
    columns, rows = taken(grid.shape[0], stride[0]), taken(grid.shape[1], stride[1]) if grid.dim == 2 else np.arange(1)
    own_columns = (columns >= grid.x_start) & (columns < grid.x_end)
    own_rows = (rows >= grid.y_start) & (rows < grid.y_end)
    box = values.reshape(grid.box)
    part = box[np.ix_(rows[own_rows] - grid.y_start, columns[own_columns] - grid.x_start)]
    if grid.comm.rank > 0:
        grid.comm.send((own_rows, own_columns, part), dest=0)
        return np.empty(0)
    out = np.empty((rows.size, columns.size))
    out[np.ix_(own_rows, own_columns)] = part
    for rank in range(1, grid.comm.size):  # one after the other: rank 0 holds the field and one part
        own_rows, own_columns, part = grid.comm.recv(source=rank)
        out[np.ix_(own_rows, own_columns)] = part
    return out if grid.dim == 2 else out[0]


def taken(n: int, step: int) -> np.ndarray:
    """Numbers of the points 0 to n - 1 that a stride takes, as far from the one end as from the other."""
    return np.arange((n - 1) % step // 2, n, step)


def thinning(grid: Grid, most: Mapping[int, int]) -> tuple[int, int]:
    """Steps in x and in y that leave at most so many points a direction, by the grid's dimension."""
    nx, ny = (ceil(n / most[grid.dim]) for n in (*grid.shape, 1)[:2])
    return nx, ny


def coordinates(grid: Grid | Frame, stride: tuple[int, int] = (1, 1)) -> tuple[Array, ...]:
    """Coordinates x, and y in 2D, of the points that `gather` returns, in metres; on every rank."""
    return tuple(line[taken(line.size, step)] for line, step in zip(grid.lines, stride, strict=False))


def _save_npz(solution: Solution, grid: Grid | Frame, fields: dict[str, Array], units: dict[str, str], target: str) -> None:
    arrays = {name: gather(grid, values) for name, values in fields.items()}
    arrays |= dict(zip("xy", coordinates(grid), strict=False))
    units = {name: units[name] for name in arrays}
    result = json.dumps(finite(as_dict(solution)))
    if grid.dim == 2 and solution.problem.kind == "lubrication":
        curves = [np.column_stack([np.full(len(curve), k), curve]) for k, curve in enumerate(solution.front_curves())]
        arrays["fronts"] = np.concatenate([np.empty((0, 3)), *curves])
    if grid.comm.rank > 0:
        return
    entries = {**arrays, "units": np.array(json.dumps(units)), "result": np.array(result)}
    with zipfile.ZipFile(target, "w") as archive:  # what np.savez does, but for a traceback when the disk is full
        for name, values in entries.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asarray(values), allow_pickle=False)


def _save_by_viewer(grid: Grid | Frame, fields: dict[str, Array], units: dict[str, str], target: str, result: str) -> None:
    """VTK or HDF5, by the extension. PETSc writes all that was viewed when the viewer is destroyed."""
    dm = grid.dm.duplicate() if isinstance(grid, Grid) else grid.dm()  # a copy: coordinates would stay in the grid's own
    comm = dm.comm
    viewer = PETSc.Viewer()
    try:
        if target.endswith(".h5"):
            viewer.createHDF5(target, "w", comm)
            for name, x in zip("xy", coordinates(grid), strict=False):
                vec = PETSc.Vec().createMPI(x.size, comm=comm)
                vec.setArray(x[slice(*vec.owner_range)])
                _view(vec, name, viewer, units[name])
            if len(result) <= MOST_TEXT:
                _attribute(viewer, "WriteAttribute", b"/", "result", result)
        else:
            viewer.createVTK(target, "w", comm)
            vec = dm.getCoordinateDM().createGlobalVec()
            vec.setArray(np.stack(np.broadcast_arrays(grid.x, grid.y)[: grid.dim], axis=-1).ravel())
            dm.setCoordinates(vec)
            vec.destroy()
        for name, values in fields.items():
            vec = dm.createGlobalVec()
            vec.setArray(values.ravel())
            _view(vec, name, viewer, units[name])
        viewer.destroy()
        if not target.endswith(".h5") and comm.rank == 0 and not _ends_whole(Path(target)):
            raise OSError("cut short; is the disk full?")  # PETSc does not tell
    except PETSc.Error:
        if viewer:
            viewer.incRef()  # never destroyed: PETSc would try to write once more, and leave an empty file
        raise
    finally:
        dm.destroy()


def _ends_whole(path: Path) -> bool:
    """Whether a VTK file has its last line."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 100))
        return b"</VTKFile>" in file.read()


def _view(vec: PETSc.Vec, name: str, viewer: PETSc.Viewer, unit: str) -> None:
    vec.setName(name)
    vec.view(viewer)
    if viewer.getType() == PETSc.Viewer.Type.HDF5:
        _attribute(viewer, "WriteObjectAttribute", vec.handle, "units", unit)
    vec.destroy()  # a VTK viewer keeps a reference until it writes


def _attribute(viewer: PETSc.Viewer, call: str, where: Any, name: str, text: str) -> None:
    """A text beside a dataset or a group: petsc4py has no call for attributes, PETSc has."""
    write = getattr(ctypes.CDLL(PETSc.__file__), f"PetscViewerHDF5{call}")
    write.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p]
    if error := write(viewer.handle, where, name.encode(), PETSC_STRING, text.encode()):
        raise PETSc.Error(error)


def _wrong_extension(suffix: str, plot: bool) -> str:
    """What is wrong with an extension, and what is allowed; empty if nothing is."""
    allowed, others, flag = (PICTURES, FIELD_FILES, "--output") if plot else (FIELD_FILES, PICTURES, "--plot")
    if suffix in allowed:
        return ""
    hint = f"; {suffix} is for {flag}" if suffix in others else nearest(suffix, allowed)
    return f"{f'extension {suffix}' if suffix else 'no extension'}; allowed are {', '.join(allowed)}{hint}"


def _fault(path: Path, plot: bool) -> str:
    """What is wrong with a target; empty if nothing is."""
    suffix = path.suffix.lower()
    if wrong := _wrong_extension(suffix, plot):
        return wrong
    if plot and find_spec("matplotlib") is None:
        return "pictures need matplotlib: pip install lcp-lube[plot]"
    if suffix == ".h5" and not PETSc.Sys.hasExternalPackage("hdf5"):
        return "this PETSc was built without HDF5; use .npz, .vts or .vtr"
    return not_writable(path)
