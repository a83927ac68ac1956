"""Half of a line's grid, half or a quarter of a rectangle's, for what is symmetric about the middle in x, in y, or in both.

Its first points, with nothing flowing through the ends in the middle. For an even number of points the middle is the outer face
of the last cell; for an odd number the last point lies on it, in half a cell. The part's rows are the whole problem's for
symmetric unknowns, halved on a middle line, so that a symmetric matrix stays one.
"""

from petsc4py import PETSc

from .grid import OPEN, Grid

Axes = tuple[bool, ...]  # whether x, and in 2D y, are folded
FOLDED = ("closed", "mirror")


def part_shape(shape: tuple[int, ...], axes: Axes) -> tuple[int, ...]:
    """Numbers of points of the part."""
    return tuple((n + 1) // 2 if folded else n for n, folded in zip(shape, axes, strict=True))


def part_grid(
    shape: tuple[int, ...],
    lengths: tuple[float, ...],
    axes: Axes,
    comm: PETSc.Comm | None = None,
    origin: tuple[float, float] = (0.0, 0.0),
) -> Grid:
    """The part's grid, of a whole with these numbers of points and sides; the whole one where no axis is folded. Collective.

    Raises
    ------
    InputError : more ranks than the part can be dealt to.
    """
    middle = ("mirror" if n % 2 else "closed" for n in shape)
    ends = [("open", end) if folded else OPEN for end, folded in zip(middle, axes, strict=True)]
    halves = tuple(0.5 * length if folded else length for length, folded in zip(lengths, axes, strict=True))
    return Grid(part_shape(shape, axes), halves, comm, origin, (ends[0], ends[-1]))


def folded_axes(grid: Grid) -> Axes:
    """Which axes of a grid of this file, or of a whole rectangle, are folded."""
    return tuple(last in FOLDED for _, last in grid.ends)


def whole_shape(grid: Grid) -> tuple[int, ...]:
    """Numbers of points of the whole that a part belongs to."""
    return tuple(
        2 * n - (last == "mirror") if last in FOLDED else n for n, (_, last) in zip(grid.shape, grid.ends, strict=True)
    )


def whole_lengths(grid: Grid) -> tuple[float, ...]:
    """Sides of the whole that a part belongs to."""
    return tuple(2.0 * length if f else length for length, f in zip(grid.lengths, folded_axes(grid), strict=True))
