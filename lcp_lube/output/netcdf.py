"""Fields as NetCDF with names and units as the CF conventions have them, by SciPy's writer: no other library is needed."""

import json
from typing import Any

import numpy as np
from scipy.io import netcdf_file

from .. import __version__
from ..base.parallel import Array
from ..problems.solution import Solution
from .results import as_dict, finite
from .style import NAMES

# What UDUNITS, which CF refers to, calls them; the others are its own.
UNITS = {"": "1", "deg": "degree"}
LONG_NAMES = {**NAMES, "p": "pressure, absolute", "x": "distance in the direction of motion", "y": "distance across it"}


def write_netcdf(solution: Solution, lines: dict[str, Array], fields: dict[str, Array], target: str) -> None:
    """Write whole fields, shape (ny, nx) or (nx,), over their coordinates, and every number of the answer. One rank.

    NetCDF-3 with 64-bit offsets, which every reader of NetCDF takes.
    """
    dims = ("y", "x")[-len(lines) :]
    units = solution.units
    with netcdf_file(target, "w", version=2) as file:
        file.Conventions = "CF-1.11"
        file.title = f"film of {solution.settings.get('scene') or 'a problem'}"
        file.source = f"lcp_lube {__version__}"
        file.result = json.dumps(finite(as_dict(solution)))
        for name in dims:
            file.createDimension(name, lines[name].size)
            _put(file, name, (name,), lines[name], units[name]).axis = name.upper()
        for name, values in fields.items():
            _put(file, name, dims, values, units[name])
        for name, value in solution.numbers.items():
            if isinstance(value, int | float) and not isinstance(value, bool) and name not in fields:
                _put(file, name, (), np.float64(value), units[name])


def _put(file: Any, name: str, dims: tuple[str, ...], values: Any, unit: str) -> Any:
    variable = file.createVariable(name, "d", dims)
    variable[...] = values
    variable.units = UNITS.get(unit, unit)
    variable.long_name = LONG_NAMES.get(name, name.replace("_", " "))
    return variable
