"""The panels of a section: p and r along a line, and the film with the liquid in it."""

from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.film.quantities import open_pressures
from .liquid import NOISE
from .picture import Picture, largest
from .style import BLUE, CAVITY, GREY, LIQUID, NAMES, RED, WALL, Axes
from .units import prefix

ANGLES = range(0, 361, 60)


def section(upper: Axes, lower: Axes, picture: Picture, row: int | None = None, named: bool = True) -> list[Any]:
    """p and r along a line in the upper axes, the film and the liquid in it in the lower ones.

    r is drawn at the faces, where the scheme knows how much liquid passes: at the points it would come half a cell late.

    Parameters
    ----------
    picture : of a lubrication problem.
    row : which row of a 2D picture; boundary values of p are added at open ends of the line.
    named : name the fronts above the upper axes.

    Returns
    -------
    What a legend should show.
    """
    problem: Any = picture.solution.problem
    scale, label_x = picture.along
    ends = problem.grid.origin[0] + np.array([0.0, problem.grid.lengths[0]])
    sign = picture.sign if row is None else picture.sign[row]
    x, p = pressure_line(picture, row)
    most_p = largest(p) if largest(p) > NOISE * picture.scales["p"] else picture.scales["p"]
    to_p, unit_p = prefix(most_p, "Pa")
    p = to_p * p
    fine = picture.fine()
    x_r, r, liquid = liquid_line(picture, row, fine)
    most_r, h = largest(r), picture.film(row, fine)
    to_h, unit_h = prefix(largest(h), "m")

    known = picture.fronts if row is None or row == picture.middle else {}
    spans = [upper.axvspan(scale * a, scale * b, color=CAVITY, lw=0) for a, b in cavities(picture.x, sign, ends, known)]
    near = np.ptp([*known.values()] or [0.0]) < 0.15 * np.ptp(ends)  # so near that their names would touch
    outwards = np.argsort(np.argsort([*known.values()]))
    for (name, place), side in zip(known.items(), outwards, strict=True):
        upper.axvline(scale * place, color=GREY, lw=0.8, ls=(0, (1, 2)))
        if named:
            text, ha = f"{name}\n{picture.place(place)}", ("right", "left")[side] if near and len(known) > 1 else "center"
            ha = "right" if place > ends[1] - 0.08 * np.ptp(ends) else ha  # clear of the right axis
            upper.text(scale * place, 1.01, text, transform=upper.get_xaxis_transform(), ha=ha, va="bottom", fontsize=8)

    right = upper.twinx()
    handles = upper.plot(scale * x, p, color=BLUE, lw=2.0, label=NAMES["p"])
    handles += right.plot(scale * x_r, r, color=RED, lw=1.8, ls="-.", label=NAMES["r"])
    if (exact := picture.exact) is not None:
        exact_p, exact_r = to_p * (exact.p(fine) + problem.p_c), exact.r(fine)
        handles += upper.plot(scale * fine, exact_p, "k--", lw=0.8, label="exact")
        right.plot(scale * fine, exact_r, "k--", lw=0.8)
        most_p, most_r = max(most_p, largest(exact_p) / to_p), max(most_r, largest(exact_r))
    upper.set(ylim=(min(0.0, 1.05 * np.nanmin(p)), 1.08 * to_p * most_p), xlim=scale * ends)
    right.set_ylim(0.0, 1.08 * max(most_r, 1e-3) if most_r > picture.noise("r") else 1.0)
    upper.set_ylabel(f"{NAMES['p']} ({unit_p})", color=BLUE)
    right.set_ylabel(NAMES["r"], color=RED)
    for span in spans[:1]:
        span.set_label("cavity")

    top = 1.25 * to_h * h.max()
    lower.fill_between(scale * fine, 0.0, to_h * liquid, color=LIQUID, lw=0)
    lower.fill_between(scale * fine, to_h * h, top, facecolor=WALL, edgecolor="0.45", hatch="////", lw=0)
    lower.plot(scale * fine, to_h * h, color="black", lw=1.4)
    lower.spines["bottom"].set_linewidth(2.0)
    lower.annotate("", (0.11, 0.14), (0.02, 0.14), xycoords="axes fraction", arrowprops={"arrowstyle": "->"})
    lower.text(0.12, 0.14, "U      liquid (1 - r) h", transform=lower.transAxes, va="center")
    if picture.is_journal:
        lower.set_xticks(ANGLES)
    lower.set(ylim=(0.0, top), ylabel=f"{NAMES['h']} ({unit_h})", xlabel=label_x)
    return [*handles, *spans[:1]]


def liquid_line(picture: Picture, row: int | None, x: Array) -> tuple[Array, Array, Array]:
    """Places of the faces of a row (m), from end to end, the void fraction there, and the liquid's thickness (m) at x.

    Around a point of the full film the share of the gap that is filled is taken to vary linearly from face to face, so that
    a full film stays full across an edge; around a point of the cavity the thickness is, and the void takes what is left.
    """
    problem: Any = picture.solution.problem
    grid = problem.grid
    start, end = grid.origin[0], grid.origin[0] + grid.lengths[0]
    r, sign = (field if row is None else field[row] for field in (picture.void, picture.sign))
    entering = {"open": 0.0, "periodic": r[-1]}.get(grid.ends[0][0], r[0])
    faces = np.concatenate([[start], picture.x + picture.ahead, [end]])
    fed = grid.ends[0][1] == "open" and problem.p_sides[1] > 0.0  # the side itself is full
    r = np.concatenate([[entering], r, 0.0 * r[-1:] if fed else r[-1:]])
    h = picture.film(row, x)
    share = (1.0 - np.interp(x, faces, r)) * h
    layer = np.interp(x, faces, (1.0 - r) * picture.film(row, faces))
    nearest = np.searchsorted(0.5 * (picture.x[1:] + picture.x[:-1]), x)
    return faces, r, np.where(sign[nearest] < 0.0, np.minimum(layer, h), share)


def pressure_line(picture: Picture, row: int | None) -> tuple[Array, Array]:
    """x (m) and absolute pressure (Pa) along a row, from end to end."""
    problem: Any = picture.solution.problem
    p = picture.fields["p"][0] if row is None else picture.fields["p"][0][row]
    start, L = problem.grid.origin[0], problem.grid.lengths[0]
    around = 0.5 * (p[0] + p[-1])
    beside = (around, around) if problem.grid.periodic[0] else (p[0], p[-1])
    sides = open_pressures(problem)[:2]
    first, last = (near if side is None else side + problem.p_c for side, near in zip(sides, beside, strict=True))
    return np.concatenate([[start], picture.x, [start + L]]), np.concatenate([[first], p, [last]])


def cavities(x: Array, sign: Array, ends: Array, fronts: dict[str, float]) -> list[tuple[float, float]]:
    """Where the cavities of a line begin and end, in m: half-way between points, or at the front that is known there."""
    edges = np.concatenate([ends[:1], (x[1:] + x[:-1]) / 2, ends[1:]])
    change = np.diff(np.concatenate([[0], (sign < 0).astype(int), [0]]))
    first, last = edges[:-1][change[:-1] > 0], edges[change < 0]
    for name, these in (("rupture", first), ("reformation", last)):
        if name in fronts and these.size:
            these[np.argmin(np.abs(these - fronts[name]))] = fronts[name]
    return list(zip(first, last, strict=True))
