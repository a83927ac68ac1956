"""What an engineer reads off the fields: load, friction, flows, power, largest pressure, thinnest film, cavity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ...base.crew import by_rows
from ...base.parallel import Array
from ..strips import Scaled, apart
from .cavity import cavitated
from .flows import friction, side_flows
from .forces import ambient, flow_growth, forces, open_pressures, totals
from .fronts import cavitated_area, first_cavity, fronts, line_fronts
from .peak import Window
from .rim_tops import rim_top
from .supplies import supply_flows

if TYPE_CHECKING:
    from .known import Known
    from .lubrication import LubricationProblem

# Of a 2D film; what is not named has none. In 1D everything is per metre of width.
UNITS = {
    **dict.fromkeys(("supply_p", "p_max", "p_ambient", "p_unit"), "Pa"),
    **dict.fromkeys(
        ("load", "pressure_integral", "load_above_ambient", "bearing_load", "load_vector", "force", "friction"), "N"
    ),
    **dict.fromkeys(("p_max_at", "min_h", "min_h_at", "rupture", "reformation", "ruptures", "reformations"), "m"),
    **dict.fromkeys(("flow", "side_leakage", "flow_growth", "groove_flow", "supply_flow"), "m3/s"),
    **{"deflection_max": "m", "asperity_load": "N", "asperity_p_max": "Pa"},
    "cavitated_area": "m2",
    **dict.fromkeys(("moment", "friction_torque"), "N m"),
    "pad_load": "N",
    "pad_tilts": "rad",
    **dict.fromkeys(("inner_flow", "outer_flow"), "m3/s"),
    "pressure_centre": "m, deg",
    **dict.fromkeys(("power_loss", "heat_power", "heat_out", "heat_stored"), "W"),
    **dict.fromkeys(("temperature_max", "temperature_effective", "temperature_out"), "K"),
    "attitude_deg": "deg",
}
SAME = 1e-3  # of p_max, and of 1: how near fields are to the discrete solution whose fronts are theirs
LEAST = 1e-3  # Pa: pressures are rounding where a film carries nothing
ROUNDING = 1e-12  # of p_max, and of 1: fields that differ by no more are one
PER_WIDTH = {"N": "N/m", "W": "W/m", "m3/s": "m2/s", "m2": "m"}


def units(dim: int) -> dict[str, str]:
    """Units of the quantities of a film in one or two dimensions, by key."""
    return {name: PER_WIDTH.get(unit, unit) if dim == 1 else unit for name, unit in UNITS.items()}


def quantities(problem: LubricationProblem, p: Array, r: Array) -> dict[str, Any]:
    """Integrals and extrema of the fields, and the scene's own numbers (`problem.extras`): keys of docs/numbers.md. Collective.

    SI, pressures absolute; in 1D forces, powers and areas are per unit width (N/m, W/m, m), flows too (m2/s). What a film
    carries is in `forces.forces`, drag and flows in `flows`, fronts and cavities in `fronts`, the largest pressure in `peak`.

    Parameters
    ----------
    p, r : owned points; p in units of p_unit above the cavitation pressure.
    """
    grid, reduce = problem.grid, problem.reduce
    p_pa: Any = Scaled(p, problem.p_unit)
    cavity = cavitated(reduce, p, r)
    min_h, min_h_at = thinnest(problem)
    known = None
    if problem.integrals is not None:
        from .known import known_of  # here: of lines alone

        known = known_of(problem)
    read = _read(problem, p_pa, r, p, cavity)
    if known is not None:
        off = reduce.max(np.abs(p_pa[:] - known.p_pa)), reduce.max(np.abs(r - known.r))
        most = reduce.max(known.p_pa)
        same = off[0] <= SAME * most + LEAST and off[1] <= SAME
        exact = off[0] <= ROUNDING * most and off[1] <= ROUNDING  # read by itself, the discrete solution would say the same
        there = known.p_pa / problem.p_unit
        dry = cavitated(reduce, there, known.r)
        discrete = read if exact else _read(problem, known.p_pa, known.r, there, dry)
        read = read.corrected(discrete, known, same)
    ruptures, reformations, flow = read.ruptures, read.reformations, read.flow
    rupture, reformation = first_cavity(grid, ruptures, reformations)
    out: dict[str, Any] = {
        "p_max": read.p_max + problem.p_c,
        "p_max_at": read.p_max_at,
        **forces(problem, p_pa, r, known),
        "p_ambient": (ambient(problem) if known is None else known.ambient(problem)) + problem.p_c,
        "friction": read.friction,
        "p_unit": problem.p_unit,
        "cavitated_fraction": reduce.sum(np.array([np.count_nonzero(cavity)])) / grid.size,
        "cavitated_area": read.cavitated_area,
        "rupture": rupture,
        "reformation": reformation,
        "ruptures": ruptures,
        "reformations": reformations,
        "min_h": min_h,
        "min_h_at": min_h_at,
        "flow": flow,
    }
    if grid.dim == 2:
        out |= {"side_leakage": flow["south"] + flow["north"], "flow_growth": flow_growth(problem)}
    if grid.polar is not None:
        out["friction_torque"] = friction(problem, p_pa, r, grid.polar[0] + grid.y)
    if problem.held is not None:
        out["supply_p"] = [supply.p + problem.p_c for supply in problem.held.supplies]
        out["supply_flow"] = supply_flows(problem, p, r)
        for name, more in known.more.items() if known is not None else ():
            out[name] = [value + float(by) for value, by in zip(out[name], more, strict=True)]
    out["friction_coefficient"] = out["friction"] / out["load"] if out["load"] > 0 else None
    out["power_loss"] = out["friction"] * problem.U
    out |= problem.more
    return out | (problem.extras(out) if problem.extras else {})


def shaft_force(problem: Any, fields: Mapping[str, Array]) -> tuple[float, float]:
    """F_X and F_Y of `quantities` on the shaft that a film is wrapped round, N (1D: N/m), without all the rest. Collective."""
    film, own, known = problem.moving, problem.there(fields), None
    if film.integrals is not None:
        from .known import known_of  # here, as above

        known = known_of(film)
    p_pa: Any = Scaled(own["p"], film.p_unit)
    found = totals(film, p_pa, own["r"], known, ("force_x", "force_y"))
    return found["force_x"], found["force_y"]


@dataclass(frozen=True)
class _Read:
    """What fields say by themselves, in the units of `quantities`; p_max above p_c."""

    p_max: float
    p_max_at: list[float] | None
    friction: float
    flow: dict[str, float]
    cavitated_area: float
    ruptures: list[float]
    reformations: list[float]

    def corrected(self, discrete: _Read, known: Known, same_fronts: bool) -> _Read:
        """With the difference between the line as its film has it and the discrete solution.

        same_fronts : the fields are those of the discrete solution, and have the line's fronts.
        """
        line, flows = known.line, known.side_flows
        top, place = line.largest
        return _Read(
            self.p_max + (top - discrete.p_max),
            [place] if np.isfinite(self.p_max) else None,
            self.friction + (line.friction - discrete.friction),
            {side: value + (flows.get(side, discrete.flow[side]) - discrete.flow[side]) for side, value in self.flow.items()},
            self.cavitated_area + (line.cavitated - discrete.cavitated_area),
            *(line.fronts if same_fronts else (self.ruptures, self.reformations)),
        )


def _read(problem: LubricationProblem, p_pa: Array, r: Array, p: Array, cavity: NDArray[np.bool_]) -> _Read:
    """p_pa in Pa, p in units of p_unit; cavity : where they are `cavitated`. Collective."""
    ends = line_fronts(problem, p, r, cavity) if problem.U else None
    return _Read(
        *largest_pressure(problem, p_pa),
        friction(problem, p_pa, r),
        side_flows(problem, p, r),
        cavitated_area(problem, ends, p, cavity),
        *fronts(problem, ends),
    )


def largest_pressure(problem: LubricationProblem, p_pa: Array) -> tuple[float, list[float] | None]:
    """p - p_c in Pa at the points and sides, where `tops` is so between the points too (`peak`), and where. Collective."""
    grid = problem.grid
    p, unit = apart(p_pa)
    largest, place = largest_of(problem, p.reshape(grid.box), grid.x[0], grid.y[:, 0])
    largest *= unit
    if problem.tops and place is not None:
        largest, place = Window(grid, p_pa, place, problem.p_sides, problem.scheme.held).top()
        if (top := rim_top(problem, p, unit, largest / unit)) is not None:
            largest, place = top.value * unit, top.place
    low = [*grid.origin[: grid.dim]]
    middle = [a + 0.5 * length for a, length in zip(low, grid.lengths, strict=True)]
    for k, p_side in enumerate(open_pressures(problem)):
        if p_side is not None and p_side > largest:
            largest, place = p_side, list(middle)
            place[k // 2] = low[k // 2] + (k % 2) * grid.lengths[k // 2]
    return largest, place


def thinnest(problem: LubricationProblem) -> tuple[float, list[float] | None]:
    """Smallest film over the points and the points of the boundary, and where, m. Collective."""
    grid, film = problem.grid, problem.film
    x, y = grid.x[0], grid.y[:, 0]
    ends = [np.array([start, start + length]) for start, length in zip(grid.origin, grid.lengths, strict=False)]
    places = [(ends[0], y)] + ([(x, ends[1]), (ends[0], ends[1])] if grid.dim == 2 else [])
    films = [(problem.scheme.h, x, y)] + [(film(a[None, :], b[:, None]), a, b) for a, b in places]
    thickness, place = max((largest_of(problem, h, a, b, True) for h, a, b in films), key=lambda found: found[0])
    return -thickness, place


def largest_of(
    problem: LubricationProblem, values: Array, x: Array, y: Array, opposite: bool = False
) -> tuple[float, list[float] | None]:
    """Largest of values, or of their opposites, over y (rows) and x (columns) and its place; NaN: nowhere. Collective.

    Of equals, to within the tolerance of a solve, the first in x and then y, whatever the ranks.
    """
    parts = by_rows(lambda a, b: -values[a:b].min(axis=0) if opposite else values[a:b].max(axis=0), len(y), len(y) * len(x))
    columns = np.max(parts, axis=0)
    largest = problem.reduce.max(columns)
    if not np.isfinite(largest):
        return largest, None
    least = largest - 1e-9 * abs(largest)
    own = (np.inf, np.inf)
    if (near := columns >= least).any():
        column = int(np.argmax(near))
        line = values[:, column]
        own = float(x[column]), float(y[np.argmax(line <= -least if opposite else line >= least)])
    return largest, [*problem.grid.comm.allreduce(own, MPI.MIN)][: problem.grid.dim]
