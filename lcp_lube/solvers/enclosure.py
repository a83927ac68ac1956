"""Guaranteed bands: arrays between which the exact discrete solution lies, whatever computed them (docs/guaranteed_bounds.md).

The flow balance G as a function of z (p = max(z, 0), r = s max(-z, 0)) is inverse isotone: G(a) <= G(b) implies a <= b. So
two signs, G(z - e) <= 0 <= G(z + e), prove that the one solution lies between z - e and z + e. The guess e comes from one
linear solve; the proof are the signs, tested with a bound on the rounding of G itself.
"""

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..base.stages import Stages
from ..linear.krylov import LinearSolverError
from ..linear.system import make_system
from ..problems.film.flows import point_weights
from ..problems.film.forces import ambient
from ..problems.film.fronts import counted
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Enclosure, Fields
from .zform import ZForm

Mask = NDArray[np.bool_]
UNIT = 2.0**-53  # largest relative error of one operation
TINY = 1e-300  # more than all that underflow can add to a sum of 7 terms
RTOL = 1e-3  # of the solve for e: the signs are tested afterwards, the band need not be sharp
RESERVE = 0.04  # of the mean |G|, added everywhere, for what that solve leaves
REPAIRS = 40  # local corrections of a band before it is given up
WIDEST = 0.1  # part of the largest pressure: a wider band, though proved, says that the answer is poor


def balance(problem: LubricationProblem, fields: Fields) -> tuple[Array, Array]:
    """F1 = A p + B r - c as the sum of its face flows, and a bound on the rounding in it. Collective.

    Each of the 7 terms passes at most 8 roundings: difference, product, six additions. With u the unit roundoff, the error
    is at most 8u/(1 - 8u) times the exact sum of their moduli, and that at most (1 - u)^-8 times the computed one: 9u covers
    both. What is bounded is the error against the balance with the stored coefficients k, b, c taken as exact.
    """
    s, box = problem.scheme, problem.grid.box
    frame_p, frame_r = (problem.grid.ghosted(fields[name], outside=0.0) for name in "pr")
    p, r = (fields[name].reshape(box) for name in "pr")
    around = [frame_p[1:-1, :-2], frame_p[1:-1, 2:], frame_p[:-2, 1:-1], frame_p[2:, 1:-1]]
    if s.held is not None:
        around = [np.where(s.held, 0.0, beside) for beside in around]
    terms = [
        s.k_W * (p - around[0]),
        s.k_E * (p - around[1]),
        s.b_C * r,
        s.entering * frame_r[1:-1, :-2],
        -s.c,
    ]
    if problem.grid.dim == 2:
        terms += [s.k_S * (p - around[2]), s.k_N * (p - around[3])]
    total, moduli = np.zeros(box), np.zeros(box)
    for term in terms:
        total += term
        moduli += np.abs(term)
    return total.ravel(), (9 * UNIT * moduli + TINY).ravel()


def conditions(problem: LubricationProblem) -> str:
    """Which condition of the theorem the problem's data break, as a sentence; empty if they meet all. Collective.

    Compared number by number, without rounding: A's and -B's off-diagonal entries are nonpositive, no column hands on more
    than its diagonal has, every cell hands both p and r on to the next one along x, and every x line has an end. Then every
    blend of their columns is a nonsingular M-matrix. Lines that close have no end: of these `way_out` tells afterwards. The
    assembled equations must be these and no others.
    """
    grid, s = problem.grid, problem.scheme
    inside = grid.ghosted(np.ones(grid.local_size), outside=0.0) > 0
    west, east, south, north = inside[1:-1, :-2], inside[1:-1, 2:], inside[:-2, 1:-1], inside[2:, 1:-1]

    def seen_from(values: Array, dj: int, di: int) -> Array:
        """The neighbour's value at each owned point; 0 beyond the domain."""
        framed = grid.ghosted(values.ravel(), outside=0.0)
        return framed[1 + dj : 1 + dj + grid.box[0], 1 + di : 1 + di + grid.box[1]]

    def count(mask: Mask) -> int:
        return int(problem.reduce.sum(mask.astype(float)))

    k_next, b_next = seen_from(s.k_W, 0, 1), seen_from(s.b_W, 0, 1)
    fine = (s.k_W >= 0) & (s.k_E >= 0) & (s.k_S >= 0) & (s.k_N >= 0) & (s.b_C < 0) & (s.b_W >= 0) & np.isfinite(s.c)
    fine &= ~east | ((s.k_E >= k_next) & (-s.b_C >= b_next))
    fine &= ~west | (s.k_W >= seen_from(s.k_E, 0, -1))
    if grid.dim == 2:
        fine &= (~south | (s.k_S >= seen_from(s.k_N, -1, 0))) & (~north | (s.k_N >= seen_from(s.k_S, 1, 0)))
    if bad := count(~fine):
        return f"{bad} columns of A or B do not have an M-matrix's signs and dominance"
    hands_on = np.where(east, (k_next > 0) & (b_next > 0), s.k_E > 0)
    lines = 0 if grid.periodic[0] else grid.shape[1] if grid.dim == 2 else 1
    if count(~hands_on) or count(~east) != lines:
        return "the theorem needs an open side to the east, at the end of every line"
    # Nothing but these terms: the matrices and the face flows agree on a vector without symmetries.
    number = grid.first + np.arange(grid.local_size)
    p, r = 1.0 + np.modf(0.618033988749895 * number)[0], np.modf(0.7548776662466927 * number)[0]
    F, rounding = balance(problem, {"p": p, "r": r})
    assembled = -problem.c.reshape(grid.box)
    for entries, values in ((s.pressure_entries(), p), (s.void_entries(), r)):
        for dj, di, entry in entries:
            assembled = assembled + entry * seen_from(values, dj, di)
    size = (4 * s.diagonal - s.b_C + s.b_W + np.abs(s.c)).ravel()
    same = np.abs(assembled.ravel() - F) <= rounding + 16 * UNIT * size
    return "" if count(~same) == 0 else "its equations have terms that the theorem does not know"


def way_out(problem: LubricationProblem, lower: Fields) -> str:
    """Why columns need not end at an open side, where lines close; empty if they do: see the page's last theorem. Collective.

    A line has a cell that is full for certain. Its column hands p on to both lines beside it, and so on to an open side.
    """
    grid, s = problem.grid, problem.scheme
    if not grid.periodic[0]:
        return ""
    if grid.dim == 1 or not any(kind == "open" for kind in grid.ends[1]):
        return "no band: the film goes round, and no side across it is open"
    south = s.k_S[grid.y_start == 0 and grid.ends[1][0] != "open" :]
    north = s.k_N[: -1 if grid.y_end == grid.shape[1] and grid.ends[1][1] != "open" else None]
    if not problem.reduce.min(np.array([k.min(initial=np.inf) for k in (south, north)])) > 0:
        return "no band: the film goes round, and nothing flows across some of its faces"
    full = np.zeros(grid.shape[1])
    rows = slice(grid.y_start, grid.y_end)
    full[rows] = (lower["p"].reshape(grid.box) > 0).any(axis=1)
    if not (grid.comm.allreduce(full) > 0).all():
        return "no band: the film goes round, and a line may be cavitated all the way"
    return ""


def enclose(problem: LubricationProblem, fields: Fields, system: str, stages: Stages) -> Enclosure:
    """A band around the fields p and r that provably contains the discrete solution, or the reason why not. Collective.

    Its price is one linear solve, by the KSP that the options describe, and a few evaluations of G.

    Parameters
    ----------
    fields : any method's answer: z = p - r/s has the sign of the larger one, and keeps the balance of the cell's own terms.
    system : registry name of the matrix for that solve.
    """
    if broken := conditions(problem):
        return Enclosure(False, f"no band: {broken}")
    band = Band(problem, fields)
    if not np.isfinite(problem.reduce.sum(band.z)):
        return Enclosure(False, "no band: the answer is not finite")
    try:
        e = band.width(system, stages)
    except LinearSolverError as error:
        return Enclosure(False, f"no band: {error}")
    return concluded(problem, fields, band.prove(e, -1.0), band.prove(e, 1.0))


def concluded(problem: LubricationProblem, fields: Fields, lower: Fields | None, upper: Fields | None) -> Enclosure:
    """What two pairs of fields prove, of which the one below and the one above have the signs, or None. Collective."""
    if lower is None or upper is None:
        where = "below" if lower is None else "above"
        return Enclosure(False, f"no band: the flow balance does not have the needed sign {where} the answer; is it poor?")
    if closed := way_out(problem, lower):
        return Enclosure(False, closed)
    bounds = bounds_of(problem, fields, lower, upper)
    largest = max(problem.reduce.max(np.abs(fields["p"])) * problem.p_unit, *problem.p_sides, 1e-9 * problem.p_unit)
    if not bounds["band_p"] <= WIDEST * largest:
        return Enclosure(False, f"no band worth the name: the answer may be off by {bounds['band_p']:.1e} Pa")
    message = f"the discrete solution is proved to be within {bounds['band_p']:.1e} Pa of p"
    return Enclosure(True, message, lower, upper, bounds)


class Band:
    """z, the price of a change in it, and the sign tests."""

    def __init__(self, problem: LubricationProblem, fields: Fields):
        self.problem, self.form = problem, ZForm(problem)
        self.z = self.form.z(fields)
        self.G, rounding = balance(problem, self.form.fields(self.z))
        # G moves by this much when p and r are rounded, which z - e and z + e are.
        about = problem.grid.ghosted(np.abs(self.z) * self.form.diagonal, outside=0.0)
        near = about[1:-1, 1:-1] + about[1:-1, :-2] + about[1:-1, 2:]
        if problem.grid.dim == 2:
            near = near + about[:-2, 1:-1] + about[2:, 1:-1]
        # c is a difference of the wall's flows, rounded; methods take the difference at the faces (`problem.balance`).
        self.slack = 4 * rounding + 8 * UNIT * (near - problem.scheme.b_C).ravel()

    def width(self, system: str, stages: Stages) -> Array:
        """e ~ J(z)^-1 (|G(z)| + slack), and a little for the error of the solve itself. Collective."""
        reduce = self.problem.reduce
        w = np.abs(self.G) + self.slack
        w += RESERVE * reduce.norm(w) / np.sqrt(self.problem.size)
        full = self.z >= 0
        made = make_system(system, self.problem, stages)
        try:
            dp, dr, _ = made.solve((~full).astype(float), full.astype(float), w, np.zeros_like(w), RTOL)
        finally:
            made.destroy()
        return np.maximum(np.where(full, dp, -dr / self.form.s), 0.0)

    def prove(self, e: Array, sign: float, at: Array | None = None) -> Fields | None:
        """The pair of z + sign e, its e enlarged where needed, if G has that sign there; None if this cannot be shown.

        Where the sign fails, the cell's own e is raised by what is lacking; that only takes from its neighbours, so the rest
        stays proved or is repaired in the next round (a Gauss-Seidel step, for an M-function). By no more than that, as a
        cavitated cell hands all of it on downstream. at : pressures of cells whose balance is not tested, NaN elsewhere.
        """
        most = 16 * self.problem.reduce.max(e)
        for _ in range(REPAIRS):
            z = self.z + sign * e if at is None else np.where(np.isnan(at), self.z + sign * e, at)
            pair = self.form.fields(z)  # this is tested: s has no part in the proof
            F, rounding = balance(self.problem, pair)
            lacking = rounding - sign * F  # NaN is lacking too
            fails = ~(lacking <= 0) if at is None else ~(lacking <= 0) & np.isnan(at)
            if not self.problem.reduce.sum(fails.astype(float)):
                return pair
            e = np.where(fails, e + (lacking + self.slack) / self.form.diagonal, e)
            if not self.problem.reduce.max(e) <= most:
                break
        return None


def bounds_of(problem: LubricationProblem, fields: Fields, lower: Fields, upper: Fields) -> dict[str, float]:
    """Distances of the answer from the farther end of the band, in SI, what their own arithmetic rounds added. Collective."""
    reduce, unit = problem.reduce, problem.p_unit
    p, r = fields["p"], fields["r"]
    off_p = np.maximum(upper["p"] - p, p - lower["p"])
    off_r = np.maximum(lower["r"] - r, r - upper["r"])
    p_max, low, high = (reduce.max(a) for a in (p, lower["p"], upper["p"]))
    largest = max(abs(p_max), high, *(side / unit for side in problem.p_sides)) + abs(problem.p_c) / unit
    above = ambient(problem) / unit
    weight = point_weights(problem.grid)
    carried, least, most = (counted(problem, one["p"] * unit, one["r"]) / unit for one in (fields, lower, upper))
    off_load = np.maximum(most - carried, carried - least)
    load_rounding = (problem.size + 32) * UNIT * reduce.sum(weight * (np.abs(p) + off_p + above))  # n numbers, in any order
    return {
        "band_p": (reduce.max(off_p) + 8 * UNIT * largest) * unit,
        "band_p_max": (max(high - p_max, p_max - low) + 8 * UNIT * largest) * unit,
        "band_load": (reduce.sum(weight * off_load) + load_rounding) * problem.grid.cell * unit,
        "band_r": reduce.max(off_r) * (1 + 8 * UNIT),
    }
