"""Box scheme of the steady Reynolds equation with cavitation: film -> coefficients of A p + B r = c."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ...errors import InputError
from ..grid import Grid
from .edges import Around, face_film, jumps_of
from .integrals import LineIntegrals, check_film
from .rims import rims_across_x, rims_across_y
from .stored import Stored

Film = Callable[[Array, Array], Array]
USUAL = 1e6  # the largest coefficient lies between this and its inverse: absolute tolerances then mean something
LARGE = 1e100  # coefficients whose squares still have a norm


@dataclass(frozen=True)
class BoxScheme:
    """Coefficients on the owned points, each of shape (ny_local, nx_local); a row is a balance per unit width.

    The flow balance of point i, with p in units of p_unit and dy the mean spacing of the lines, is

        sum over faces of k_face (p_i - p_neighbour) + b_C r_i + b_W r_west = c_i        [m2/s]

    k_W, k_E = p_unit h^3/(6 mu dx);  k_S, k_N = p_unit h^3 dx/(6 mu dy2) (absent in 1D).
    On uneven lines a row is the whole balance of a cell over the mean dy: what leaves a cell is what enters the next one. In a
    sector (`Grid.polar`) arcs are longer than dx by the stretch m, the wall faster: k_W, k_E over m, k_S, k_N and U times m.
    Dirichlet neighbours are in c; `k_*` keeps their conductance, for A's diagonal and the boundary fluxes.
    """

    k_W: Array
    k_E: Array
    k_S: Array
    k_N: Array
    b_C: Array
    b_W: Array
    c: Array
    couette_W: Array  # U h at the west and east face of a cell without void: the flux balance that c holds
    couette_E: Array
    h: Array  # film at the points, m
    flow_unit: float = 1.0  # of all of them but h, m2/s: a power of 2
    held: NDArray[np.bool_] | None = None  # cells at a given pressure (`supplies`): their rows of A have the diagonal alone
    storage: Array | None = None  # of a time step: what a full cell comes to store is storage - kept; b_C has -storage in it
    kept: Array | None = None

    @property
    def arrays(self) -> list[str]:
        """Names of the coefficients and of h."""
        given = [field.name for field in fields(self) if field.name not in ("flow_unit", "held")]
        return [name for name in given if getattr(self, name) is not None]

    @property
    def b_E(self) -> Array:
        """What of b_C r leaves by the east face: all of it in a steady film."""
        return self.b_C if self.storage is None else self.b_C + self.storage

    @property
    def diagonal(self) -> Array:
        """A's."""
        return self.k_W + self.k_E + self.k_S + self.k_N

    @property
    def coupling(self) -> tuple[Array, Array, Array, Array]:
        """The conductances to west, east, south and north as A's rows have them: none of a cell that is held."""
        k = (self.k_W, self.k_E, self.k_S, self.k_N)
        return k if self.held is None else tuple(np.where(self.held, 0.0, a) for a in k)  # type: ignore[return-value]

    @property
    def entering(self) -> Array:
        """B's entry for the void from the west: a cell that is held swallows it."""
        return self.b_W if self.held is None else np.where(self.held, 0.0, self.b_W)

    def pressure_entries(self) -> list[tuple[int, int, Array]]:
        """Row entries of A as (dj, di, value)."""
        west, east, south, north = self.coupling
        entries = [(0, 0, self.diagonal), (0, -1, -west), (0, 1, -east)]
        if self.k_S.any() or self.k_N.any():
            entries += [(-1, 0, -south), (1, 0, -north)]
        return entries

    def void_entries(self) -> list[tuple[int, int, Array]]:
        """Row entries of B as (dj, di, value)."""
        return [(0, 0, self.b_C), (0, -1, self.entering)]


def box_scheme(grid: Grid, film: Film, **data: Any) -> BoxScheme:
    """`coefficients` of these data, checked; in a unit of flow by which the largest is near 1 where it would be far from it.

    Raises
    ------
    InputError : a film that is not positive, or data so large or small that a coefficient overflows or vanishes.
    """
    with np.errstate(all="ignore"):
        box = coefficients(grid, film, **data)
    reduce = grid.reduce
    faces = [box.k_W, box.k_E] + ([box.k_S, box.k_N] if grid.dim == 2 else [])
    walls = zip(sides(grid, ("closed", "mirror")), faces, strict=False)
    stores = [] if box.storage is None else [box.storage]
    conducting = [np.where(wall, np.inf, k) if wall.any() else k for wall, k in walls]
    smallest = min(map(reduce.min, [box.h, *conducting, *stores]))
    largest = max(map(reduce.max, [*faces, np.abs(box.b_C), np.abs(box.c)]))
    if not (smallest > 1 / LARGE and largest < LARGE):
        with np.errstate(all="ignore"):
            check_film(grid, film)
        raise InputError(
            f"film {reduce.min(box.h):g} to {reduce.max(box.h):g} m, mu = {data['mu']:g} Pa s, U = {data['U']:g} m/s, "
            f"p_unit = {data['p_unit']:g} Pa: flow balance with coefficients {smallest:g} to {largest:g}, "
            f"allowed are {1 / LARGE:g} to {LARGE:g} (SI units?)"
        )
    if 1 / USUAL < largest < USUAL:
        return box
    unit = 2.0 ** np.round(np.log2(largest))
    return replace(box, **{name: getattr(box, name) / unit for name in box.arrays if name != "h"}, flow_unit=float(unit))


def coefficients(
    grid: Grid,
    film: Film,
    *,
    mu: float,
    U: float,
    scheme: str,
    p_sides: tuple[float, float, float, float],
    p_unit: float,
    mean_cubes: bool = False,
    r_in: float = 0.0,
    cavity: Array | None = None,
    integrals: LineIntegrals | None = None,
    stored: Stored | None = None,
) -> BoxScheme:
    """Coefficients of the box scheme on the owned points; the grid's ends say what its sides are.

    Parameters
    ----------
    film : h(x, y) in metres for arrays of coordinates in metres that broadcast.
    mu, U : viscosity in Pa s, speed of the moving wall in m/s (the flow goes to larger x; `Model` mirrors films for U < 0).
        U = 0: void travels nowhere, and its columns are those of some speed: the answer has r = 0 for any.
    scheme : form of the Couette flux. 'nodal' (paper, eq. 7): U (h_face - (h r)_upwind); 'face': U h_face (1 - r_upwind);
        'upwind': U (h (1 - r))_upwind.
    p_sides : Dirichlet pressures above the cavitation pressure at west, east, south, north in Pa (south, north: 2D only);
        read where the grid's end is open.
    p_unit : pressure unit in Pa; p in the equations is measured in it.
    mean_cubes : take h^3 at a face as the mean of the nodal values (scene 5) instead of the film at the face.
    r_in : void fraction that enters at an open west side.
    cavity : 1 at the owned points that are taken to be cavitated where round edges cut a face (`rims`), else 0; default 0.
    stored : what the cells store, in a time step.
    integrals : of a line's film (1D): fluxes between its points are exact for a full film; default: from the film at the faces.
    """
    dx, (ny, nx) = grid.steps(0), grid.box
    x_share, y_share = grid.widths(0), grid.widths(1)[:, None] if grid.dim == 2 else np.ones((1, 1))
    x_nodes, x_faces = grid.nodes_and_faces(0)
    x, y = x_nodes[None, 1:-1], grid.y
    film = Around(film, grid)
    period = [length if around else 0.0 for length, around in zip(grid.lengths, grid.periodic, strict=True)]
    h_x = np.broadcast_to(film(x_nodes[None, :], y), (ny, nx + 2))
    h_face = np.broadcast_to(film(x_faces[None, :], y), (ny, nx + 1))
    h = np.array(h_x[:, 1:-1])

    def cubes(at_faces: Array, at_nodes: Array) -> Array:
        """h^3 at the faces, which come first to last along axis 0."""
        if not mean_cubes:
            return at_faces**3
        nodal = at_nodes**3
        return 0.5 * (nodal[:-1] + nodal[1:])

    k = p_unit / (6.0 * mu)
    x_jumps, y_jumps = ((), ()) if mean_cubes else (jumps_of(film, axis) for axis in "xy")
    across = grid.steps(1) if grid.dim == 2 else np.ones(2)
    if integrals is not None:
        own = slice(grid.x_start, grid.x_end + 1)
        cubes_x, h_face = dx / integrals.parts[2][None, own], integrals.films[None, own]
    elif x_jumps or y_jumps:
        cubes_x, h_face = face_film(film, x_nodes, x_faces, y[:, 0], x_jumps, y_jumps, across, period[0])
    else:
        cubes_x = cubes(h_face.T, h_x.T).T
    rims = [] if mean_cubes or scheme != "face" or grid.dim == 1 else getattr(film, "rims", [])
    if rims:
        cubes_x, h_face = rims_across_x(grid, film, rims, cavity, cubes_x, h_face, period[0])
    m = grid.stretch(y)
    k_x = k * cubes_x / dx * (y_share / m)
    k_W, k_E = k_x[:, :-1], k_x[:, 1:]  # a face's conductance is stored once
    if grid.dim == 2:
        y_nodes, y_faces = grid.nodes_and_faces(1)
        h_y = np.broadcast_to(film(x, y_nodes[:, None]), (ny + 2, nx))
        at_y_faces = np.broadcast_to(film(x, y_faces[:, None]), (ny + 1, nx))
        if x_jumps or y_jumps:
            turned = face_film(lambda t, s: film(s, t), y_nodes, y_faces, x[0], y_jumps, x_jumps, dx, period[1])
            cubes_y = turned[0].T
        else:
            cubes_y = cubes(at_y_faces, h_y)
        if rims:
            cubes_y = rims_across_y(grid, film, rims, cavity, cubes_y, period[1])
        arcs = grid.spacing[0] * x_share * grid.stretch(y_faces)[:, None]
        k_y = k * cubes_y * arcs / (grid.steps(1) * grid.spacing[1])[:, None]
        k_S, k_N = k_y[:-1], k_y[1:]
    else:
        k_S = k_N = np.zeros(grid.box)

    first = (np.arange(grid.x_start, grid.x_end) == 0)[None, :]
    h_W = h_x[:, :-2]
    if U == 0.0:
        # No void is carried, and there is none: any speed keeps B regular, as what cells store does.
        U_r, r_in = 0.0 if stored else grid.reduce.max(np.real(k_x)) / grid.reduce.max(np.real(h)), 0.0
    else:
        U_r = U
    if scheme == "upwind":
        couette_W, couette_E = U * h_W, U * h
    else:
        couette_W, couette_E = U * h_face[:, :-1], U * h_face[:, 1:]
    if scheme == "face":
        b_C, b_W = -U_r * h_face[:, 1:], U_r * h_face[:, :-1]
    else:
        b_C, b_W = -U_r * h, U_r * h_W
    couette_W, couette_E, b_C, b_W = (y_share * m * a for a in (couette_W, couette_E, b_C, b_W))
    open_west, *_ = sides(grid)
    if r_in:
        couette_W = couette_W - np.where(open_west, b_W * r_in, 0.0)
    if not grid.periodic[0] or U == 0.0:
        b_W = np.where(first, 0.0, b_W)  # what enters is in c
    if any(end != "open" for pair in grid.ends for end in pair):
        # Column sums stay >= 0, those of A and B are 0 in the cells away from open sides. b_C stays at a closed east side: in
        # every solution with flow r is 0 there, as what arrives must be pressed back.
        west, east, south, north = sides(grid, ("closed", "mirror"))
        k_W, k_E = np.where(west, 0.0, k_W), np.where(east, 0.0, k_E)
        k_S, k_N = np.where(south, 0.0, k_S), np.where(north, 0.0, k_N)
        couette_W, couette_E = np.where(west, 0.0, couette_W), np.where(east, 0.0, couette_E)

    c = couette_W - couette_E
    for conductance, points, p_side in zip((k_W, k_E, k_S, k_N), side_points(grid), p_sides, strict=True):
        c[points] += conductance[points] * (p_side / p_unit)
    box = BoxScheme(k_W, k_E, k_S, k_N, b_C, b_W, c, couette_W, couette_E, h)
    if stored is None:
        return box
    # Twice a cell's area over the mean dy.
    return replace(box, **stored.terms(grid, film, 2.0 * grid.spacing[0] * x_share * y_share * m, b_C, c))  # type: ignore[arg-type]


def sides(grid: Grid, kinds: Sequence[str] = ("open",)) -> tuple[NDArray[np.bool_], ...]:
    """Masks (they broadcast to `grid.box`) of the owned points at the west, east, south and north end, if of these kinds."""
    i = np.arange(grid.x_start, grid.x_end)[None, :]
    j = np.arange(grid.y_start, grid.y_end)[:, None]
    masks = [i == 0, i == grid.shape[0] - 1]
    masks += [j == 0, j == grid.shape[1] - 1] if grid.dim == 2 else [np.zeros((1, 1), dtype=bool)] * 2
    found = [end in kinds for pair in grid.ends for end in pair] + [False, False]
    return tuple(mask & is_found for mask, is_found in zip(masks, found, strict=False))


def side_points(grid: Grid) -> tuple[tuple[slice | NDArray, slice | NDArray], ...]:
    """The owned points at the open ends of `sides` as indices into arrays of `grid.box`."""
    west, east, south, north = (np.flatnonzero(mask) for mask in sides(grid))
    every = slice(None)
    return (every, west), (every, east), (south, every), (north, every)
