"""Where a film is not positive."""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from ...base.parallel import Array
from ...errors import InputError
from ..grid import Grid


def check_film(grid: Grid, film: Callable[[Array, Array], Array]) -> None:
    """Raise InputError with the place where the film is thinnest, unless it is positive on all nodes and faces. Collective."""
    x_nodes, x_faces = grid.nodes_and_faces(0)
    y_nodes, y_faces = grid.nodes_and_faces(1) if grid.dim == 2 else (np.zeros(1), np.zeros(1))
    lowest = (np.inf, 0.0, 0.0)
    for x, y in ((x_nodes, y_nodes), (x_faces, y_nodes), (x_nodes, y_faces)):
        x, y = x[None, :], y[:, None]
        h = np.nan_to_num(np.broadcast_to(film(x, y), (y.size, x.size)), nan=-np.inf, posinf=np.inf, neginf=-np.inf)
        j, i = np.unravel_index(np.argmin(h), h.shape)
        lowest = min(lowest, (float(h[j, i]), float(x[0, i]), float(y[j, 0])))
    h_min, at_x, at_y = grid.comm.allreduce(lowest, MPI.MIN)
    if not h_min > 0:
        where = f"x = {at_x:g}" + (f", y = {at_y:g}" if grid.dim == 2 else "")
        found = f"{h_min:g} m" if np.isfinite(h_min) else "no number"
        raise InputError(f"film {found} at {where} m: it must be positive everywhere")
