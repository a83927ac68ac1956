"""Box scheme of the steady Reynolds equation with cavitation: film -> coefficients of A p + B r = c."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ...errors import InputError
from ..grid import Grid
from ..strips import each_strip, in_strips, places_of
from . import strip
from .cavity import ruptured
from .edges import Around
from .integrals import LineIntegrals, check_film
from .stored import Stored

Film = Callable[[Array, Array], Array]
USUAL = 1e6  # the largest coefficient lies between this and its inverse: absolute tolerances then mean something
LARGE = 1e100  # coefficients whose squares still have a norm


class Made:
    """An array, or a function that makes it whenever it is asked for: what is seldom asked for takes no memory."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, scheme: Any, owner: type | None = None) -> Array:
        if scheme is None:
            raise AttributeError(self._name)  # so that the dataclass sees no default
        value = scheme.__dict__[self._name]
        return value() if callable(value) else value

    def __set__(self, scheme: Any, value: Array | Callable[[], Array]) -> None:
        scheme.__dict__[self._name] = value


@dataclass(frozen=True)
class BoxScheme:
    """Coefficients on the owned points, each of shape (ny_local, nx_local); a row is a balance per unit width.

    The flow balance of point i, with p in units of p_unit and dy the mean spacing of the lines, is

        sum over faces of k_face (p_i - p_neighbour) + b_C r_i + b_W r_west = c_i        [m2/s]

    k_W, k_E = p_unit h^3/(6 mu dx);  k_S, k_N = p_unit h^3 dx/(6 mu dy2) (absent in 1D).
    On uneven lines a row is the whole balance of a cell over the mean dy: what leaves a cell is what enters the next one. In a
    sector (`Grid.polar`) arcs are longer than dx by the stretch m, the wall faster: k_W, k_E over m, k_S, k_N and U times m.
    Dirichlet neighbours are in c; `k_*` keeps their conductance, for A's diagonal and the boundary fluxes.

    As `box_scheme` makes them, k_W and k_E are parts of one array, and so are k_S and k_N, couette_W and couette_E, of which
    b_C and b_W are made when they are asked for: 40 bytes a point in all, 24 where lines alike share couette_* and h.
    """

    k_W: Array
    k_E: Array
    k_S: Array
    k_N: Array
    c: Array
    h: Array  # film at the points, m
    couette_W: Made = Made()  # U h at the west and east face of a cell without void: the flux balance that c holds
    couette_E: Made = Made()
    b_C: Made = Made()
    b_W: Made = Made()
    flow_unit: float = 1.0  # of all of them but h, m2/s: a power of 2
    held: NDArray[np.bool_] | None = None  # cells at a given pressure (`supplies`): their rows of A have the diagonal alone
    storage: Array | None = None  # of a time step: what a full cell comes to store is storage - kept; b_C has -storage in it
    kept: Array | None = None
    gives: Array | None = None  # and what it stores more by p = 1, where that is linearised: on A's diagonal

    def rows(self, rows: slice) -> "BoxScheme":
        """Those of some lines of points."""
        if rows.stop - rows.start == len(self.h):
            return self

        def cut(value: Any) -> Any:
            if isinstance(value, partial):
                return partial(value.func, *map(cut, value.args))
            return value[rows] if isinstance(value, np.ndarray) else value

        return self.changed(**{name: cut(value) for name, value in vars(self).items()})

    def in_strips(self, grid: Grid) -> Iterator[tuple[slice, "BoxScheme"]]:
        """This rank's lines strip by strip, and their coefficients."""
        return ((rows, self.rows(rows)) for rows in in_strips(grid))

    def changed(self, **changes: Any) -> "BoxScheme":
        """With other fields; what is made when it is asked for stays so, which `dataclasses.replace` would make and keep."""
        other = object.__new__(BoxScheme)
        other.__dict__.update(vars(self) | changes)
        return other

    @property
    def arrays(self) -> list[str]:
        """Names of the coefficients and of h."""
        given = [field.name for field in fields(self) if field.name not in ("flow_unit", "held")]
        return [name for name in given if getattr(self, name) is not None]

    @property
    def b_E(self) -> Array:
        """What of b_C r leaves by the east face: all of it in a steady film."""
        return self.b_C if self.storage is None else self.b_C + self.storage

    def b_E_at(self, row: Any, i: Any) -> Array:
        """`b_E` of some cells, without an array of them all."""
        b_C = vars(self)["b_C"]
        some = strip.leaving_at(row, i, *b_C.args) if isinstance(b_C, partial) else b_C[row, i]
        return some if self.storage is None else some + self.storage[row, i]

    def b_W_at(self, row: Any, i: Any) -> Array:
        """`b_W` of some cells."""
        b_W = vars(self)["b_W"]
        return strip.entering_at(row, i, *b_W.args) if isinstance(b_W, partial) else b_W[row, i]

    @property
    def diagonal(self) -> Array:
        """A's."""
        faces = self.k_W + self.k_E + self.k_S + self.k_N
        return faces if self.gives is None else faces + self.gives

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
        x, y = (grid.nodes_and_faces(side)[0] if side < grid.dim else np.zeros(1) for side in (0, 1))
        ends = [np.ravel(film(*at)) for at in ((x[None, [0, -1]], y[:, None]), (x[None, :], y[[0, -1], None]))]
    reduce = grid.reduce
    # Every face once, k_E and k_N are k_W and k_S but for the last ones; those at closed sides conduct nothing.
    west, east, south, north = (int(mask.any()) for mask in sides(grid, ("closed", "mirror")))
    faces = [box.k_W[:, west:], box.k_E[:, -1:][:, east:]] + ([box.k_S[south:], box.k_N[-1:][north:]] if grid.dim == 2 else [])
    stores = [] if box.storage is None else [box.storage]
    lows, highs = zip(*map(reduce.extremes, [*faces, box.c]), strict=True)
    smallest = float(np.min([*map(reduce.min, (box.h, *ends, *stores)), *lows[:-1]]))  # NaN stays NaN
    largest = max(*highs, -lows[-1], reduce.max(strip.most_leaving(box)))
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
    held = [value.args if isinstance(value, partial) else (value,) for value in vars(box).values()]
    arrays = [a if a.base is None else a.base for a in sum(held, ()) if isinstance(a, np.ndarray)]
    for a in {id(a): a for a in arrays}.values():
        if a is not box.h and a is not box.h.base:
            a /= unit
    return box.changed(flow_unit=float(unit))


def coefficients(
    grid: Grid,
    film: Film,
    *,
    mu: float,
    U: float,
    scheme: str,
    p_sides: tuple[float, ...],
    p_unit: float,
    mean_cubes: bool = False,
    r_in: float = 0.0,
    cavity: Array | None = None,
    integrals: LineIntegrals | None = None,
    stored: Stored | None = None,
) -> BoxScheme:
    """Coefficients of the box scheme on the owned points, made strip by strip; the grid's ends say what its sides are.

    Parameters
    ----------
    film : h(x, y) in metres for arrays of coordinates in metres that broadcast.
    mu, U : viscosity in Pa s, speed of the moving wall in m/s (the flow goes to larger x; `Model` mirrors films for U < 0).
        U = 0: void travels nowhere, and its columns are those of some speed: the answer has r = 0 for any.
    scheme : form of the Couette flux. 'nodal' (paper, eq. 7): U (h_face - (h r)_upwind); 'face': U h_face (1 - r_upwind);
        'upwind': U (h (1 - r))_upwind.
    p_sides : pressures at west, east (2D: south, north), Pa above the cavitation pressure; read where the grid's end is open.
    mean_cubes : take h^3 at a face as the mean of the nodal values (scene 5) instead of the film at the face.
    p_unit : Pa, in which p in the equations is measured. r_in : void fraction that enters at an open west side.
    cavity : `rims.state_of` the owned points, where faces are made for cavities (`rims`, `inlets`); default 0, of a full film.
    stored : what the cells store, in a time step.
    integrals : of a line's film (1D): fluxes between its points are exact for a full film; default: from the film at the faces.
    """
    (ny, nx), film = grid.box, Around(film, grid)
    rims = [] if mean_cubes or scheme != "face" or grid.dim == 1 else film.rims
    # The void is dragged as the film at the points, or as what the wall drags through the faces, which are stored anyway.
    nodal, form = scheme != "face" and U != 0.0, scheme if U or scheme == "face" else "upwind"
    first = ruptured(grid, cavity, p_sides[0] / (6.0 * mu * U)) if stored is None and np.real(U) > 0.0 else None
    kind = np.asarray(film(grid.x[:, :1], grid.y[:1])).dtype
    (kx, ky, c_frame), (films, wall) = strip.room(grid, film, bool(rims) or first is not None, kind)
    void = films if nodal else wall if U else np.zeros_like(wall)

    k = p_unit / (6.0 * mu)

    def make(rows: slice) -> None:
        here = grid if rims else places_of(grid, rows)
        inlet = first and first.of(rows)
        parts = strip.coefficients_of(here, film, k, U or 1.0, form, mean_cubes, rims, cavity, inlet, integrals)
        inside = kx[1:-1, 1:-1][rows], ky[1:-1, 1:-1][rows.start : rows.stop + 1], films[rows], (wall if U else void)[rows]
        for out, part in zip(inside, parts, strict=True):
            strip.put(out, part)

    if rims:
        make(slice(0, ny))
    else:
        each_strip(grid, make)
    if cavity is not None and not mean_cubes and film.corners.size:
        from .recesses import around_recesses  # here: few films have corners

        around_recesses(grid, film, cavity, kx[1:-1, 1:-1], ky[1:-1, 1:-1], wall, 6.0 * mu * U / p_unit)
    h, weight = films[:, 1:], strip.stream_weights(grid) * np.ones((ny, 1)) if nodal else None
    k_W, k_E, k_S, k_N = kx[1:-1, 1 : nx + 1], kx[1:-1, 2 : nx + 2], ky[1 : ny + 1, 1:-1], ky[2 : ny + 2, 1:-1]
    if U == 0.0:
        # No void is carried, and there is none: any speed keeps B regular, as what cells store does.
        void *= 0.0 if stored else grid.reduce.max(np.real(kx)) / grid.reduce.max(np.real(h))
        r_in = 0.0
    if r_in and sides(grid)[0].any():
        wall[:, :1] = wall[:, :1] - strip.dragged(void[:, :1], weight, U) * r_in
    last = None
    west, east, south, north = (mask.any() for mask in sides(grid, ("closed", "mirror")))
    # Column sums stay >= 0, those of A and B are 0 in the cells away from open sides. b_C stays at a closed east side: in
    # every steady solution with flow r is 0 there, as what arrives must be pressed back; what is stored needs no such help.
    if west:
        k_W[:, 0] = wall[:, 0] = 0.0
    if east:
        last = 0.0 * void[:, -1] if stored else None if nodal else void[:, -1].copy()
        k_E[:, -1] = wall[:, -1] = 0.0
    if south:
        k_S[0] = 0.0
    if north:
        k_N[-1] = 0.0
    couette_W, couette_E, c = wall[:, :-1], wall[:, 1:], c_frame[1:-1, 1:-1]
    each_strip(grid, lambda rows: np.subtract(couette_W[rows], couette_E[rows], out=c[rows]))
    for conductance, points, p_side in zip((k_W, k_E, k_S, k_N), side_points(grid), p_sides, strict=True):
        c[points] += conductance[points] * (p_side / p_unit)
    enters = grid.x_start > 0 or (grid.periodic[0] and U != 0.0)  # or else what does is in c
    b_C, b_W = partial(strip.leaving, void, last, weight, U), partial(strip.entering, void, enters, weight, U)
    box = BoxScheme(k_W, k_E, k_S, k_N, c, h, couette_W, couette_E, b_C, b_W)
    if stored is None:
        return box
    area = 2.0 * grid.spacing[0] * grid.widths(0) * strip.line_weights(grid) * grid.stretch(grid.y)  # twice a cell's, over dy
    return box.changed(**stored.terms(grid, film, area, box.b_C, c))


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
    every, nothing = slice(None), np.zeros(0, dtype=int)
    found: list[NDArray] = []
    parts = zip((grid.x_start, grid.y_start), grid.box[::-1], grid.shape, grid.ends, strict=False)
    for start, owned, n, (first, last) in parts:
        end = owned - int(last == "open" and start + owned == n)
        found += [np.arange(int(first == "open" and start == 0)), np.arange(end, owned)]
    west, east, south, north = found if grid.dim == 2 else [*found, nothing, nothing]
    return (every, west), (every, east), (south, every), (north, every)
