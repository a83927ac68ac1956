"""Fields as an xarray.Dataset."""

from typing import Any

from ..errors import InputError
from ..problems.solution import Solution
from .results import finite


def to_xarray(solution: Solution, boundary: bool = False) -> Any:
    """The fields in SI over the coordinates x and y, each with its unit; the numbers of the run as attributes. Collective.

    On several ranks a dataset holds the rank's own part, and its coordinates say which.

    Parameters
    ----------
    boundary : with the points of the sides.

    Raises
    ------
    InputError : xarray is missing; no sides.
    """
    try:
        import xarray
    except ImportError:
        raise InputError("to_xarray needs xarray: pip install lcp-lube[xarray]") from None
    grid, units = solution.problem.grid, solution.units
    dims = ("y", "x")[-grid.dim :]
    first = {"x": (0, ...) if grid.dim == 2 else (...,), "y": (..., 0)}  # coordinates are the same on every line
    coordinates = {name: (name, solution.field(name, boundary)[first[name]], {"units": units[name]}) for name in dims}
    fields = {
        name: (dims, solution.field(name, boundary), {"units": units[name]})
        for name in solution.problem.physical(solution.fields)
    }
    record = {name: value for name, value in finite(solution.quantities).items() if isinstance(value, bool | int | float | str)}
    return xarray.Dataset(fields, coordinates, {name: int(v) if isinstance(v, bool) else v for name, v in record.items()})
