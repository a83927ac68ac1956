"""How much memory a run takes, estimated before it starts, and how much there is.

A run's peak is what the process holds before it (Python, PETSc and their libraries, about 100 MB a rank), the compiler of
the sweeps where they are used, and so many bytes a point for data, matrix and inner solver. Those are measured
(benchmarks/memory.py prints them beside the estimates); a direct solver's grow with the logarithm of the points in 2D.
A fallback that takes over with a direct solver is not in the estimate: it may need more.
"""

import os
import resource
import sys
from dataclasses import dataclass
from math import log2
from pathlib import Path

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..base.compiled import has_numba
from ..base.options import recipe
from ..errors import InputError
from ..problems.facts import Facts
from .plan import Plan

MB = 2**20
COMPILER = 113 * MB  # numba and LLVM, once they are loaded
LIBRARIES = 5 * MB  # pages of PETSc and its packages that only a solve touches
DENSE = 24.5  # bytes for an entry of a dense Jacobian: it, its factors, a copy of them
DENSE_COPY = 17.0  # the same for -mat_type dense, a copy of a sparse matrix

# Bytes a point by (kind of problem and dimension, system, inner solver): a + b log2(points).
MEASURED: dict[tuple[str, str, str], tuple[float, float]] = {
    ("lubrication 1D", "reduced", "petsc"): (740, 0),
    ("lubrication 1D", "reduced", "mumps"): (1400, 0),
    ("lubrication 1D", "reduced", "light"): (740, 0),
    ("lubrication 1D", "full", "superlu"): (1490, 0),
    ("lubrication 1D", "full", "umfpack"): (1300, 0),
    ("lubrication 1D", "full", "klu"): (800, 0),
    ("lubrication 1D", "full", "mumps"): (1250, 0),
    ("lubrication 1D", "full", "light"): (750, 0),
    ("lubrication 2D", "", ""): (70, 0),
    ("lubrication 2D alike", "", ""): (54, 0),
    ("lubrication 2D moving", "", ""): (200, 0),
    ("lubrication 2D free", "", ""): (1100, 0),  # most of it the basis of its stiffness
    ("lubrication 2D", "cavity", "multigrid"): (780, 0),
    ("lubrication 2D", "reduced", "multigrid"): (1040, 0),
    ("lubrication 2D", "reduced", "umfpack"): (410, 82),
    ("lubrication 2D", "reduced", "superlu"): (900, 75),
    ("lubrication 2D", "reduced", "mumps"): (1400, 0),
    ("lubrication 2D", "reduced", "light"): (900, 0),
    ("lubrication 2D", "full", "umfpack"): (430, 110),
    ("lubrication 2D", "full", "superlu"): (640, 127),
    ("lubrication 2D", "full", "mumps"): (-6400, 670),
    ("lubrication 2D", "full", "light"): (830, 0),
    ("lubrication 2D", "full", "multigrid"): (1350, 0),
    ("box 2D", "jacobian", "multigrid"): (920, 0),
    ("box 2D", "jacobian", "umfpack"): (1330, 0),
    ("equations 2D", "jacobian", "multigrid"): (550, 0),
    ("equations 2D", "jacobian", "umfpack"): (1310, 0),
}
SPREAD = 16, 56  # bytes for each point of the film that a part is of: its fields; of a march those that are kept too
TWICE = 76, 46  # for each point of a film what is kept of a first solve while it is solved once more; of one by its half
LENT = 40, 24  # of these bytes a point the coefficients; of films alike along y
LITTLE = 32 * MB  # a run that needs no more starts without a look at what is free
LARGE = 1_000_000  # points from which building the problem is itself worth a look ahead
MULTIGRID = ("hypre", "ml", "gamg", "mg")


@dataclass(frozen=True)
class Estimate:
    """Bytes of all ranks together: base, what they hold before the first point (libraries, compiler), and the peak."""

    base: int
    peak: int

    @property
    def sentence(self) -> str:
        return f"memory: about {self.peak / MB:.0f} MB, {self.base / MB:.0f} MB of it whatever the number of points"

    @property
    def settings(self) -> dict[str, float]:
        """For the JSON."""
        return {"memory_base_mb": self.base / MB, "memory_estimate_mb": self.peak / MB}


def resident() -> int:
    """Bytes that this process holds in memory now."""
    try:
        return int(_of_this_process("statm").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 100 * MB


def peak() -> int:
    """Most bytes that this process has held. Not `ru_maxrss`, which begins with what the parent process held at the fork."""
    try:
        return int(_of_this_process("status").partition(b"VmHWM:")[2].split(maxsplit=1)[0]) * 1024
    except (OSError, ValueError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _of_this_process(name: str) -> bytes:
    with open(f"/proc/self/{name}", "rb", buffering=0) as file:
        return file.read()


def available() -> int:
    """Bytes that this machine, or the control group that the process runs in, can still give."""
    free = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        lines = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        free = int(lines["MemAvailable"].split()[0]) * 1024
    except (OSError, ValueError, KeyError):
        pass
    return min([free, *_groups(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))])


def _groups(own: Path, root: Path) -> list[int]:
    """What the control groups above this process leave it, those that have a limit. Versions 1 and 2.

    Pages of files that could be dropped count as used by a group, but can be had.
    """
    left = []
    try:
        groups = [line.strip().split(":", 2) for line in own.read_text().splitlines()]
    except OSError:
        return []
    for _, controllers, path in groups:
        if controllers == "":
            base, names = root, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            base, names = root / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        folder = base / path.lstrip("/")
        for place in (folder, *folder.parents):
            try:
                limit, used = ((place / name).read_text().strip() for name in names[:2])
                stat = dict(line.split() for line in (place / "memory.stat").read_text().splitlines() if line)
                if limit != "max":
                    left.append(max(0, int(limit) - int(used) + int(stat.get(names[2], 0))))
            except (OSError, ValueError):
                pass
            if place == base:
                break
    return left


def inner_solver() -> str:
    """The kind of inner solver that the options in force describe, as `MEASURED` names it. No option counts as read by it."""
    options = PETSc.Options().getAll()
    pc = options.get("pc_type", "")
    if pc in ("lu", "cholesky"):
        return options.get("pc_factor_mat_solver_type", "petsc")
    if any(value in MULTIGRID for name, value in options.items() if name.endswith("pc_type")):
        return "multigrid"
    return "light"


def bytes_needed(facts: Facts, plan: Plan) -> float | None:
    """Bytes that a run takes for its points, all ranks together; None if nothing is known of such runs.

    An inner solver that was not measured counts as the most expensive one of the same system.
    """
    also = " free" if facts.free else " moving" if facts.moving else " alike" if facts.alike else ""
    points, kind = facts.size, f"{facts.kind} {facts.dim}D{'' if plan.system else also}"
    if facts.dense:
        return DENSE * points**2 * (facts.ranks if plan.recipe == "redundant_lu" else 1)
    options = PETSc.Options().getAll()
    if plan.system and "dense" in options.get("mat_type", ""):
        return DENSE_COPY * (2 * points if plan.system == "full" else points) ** 2
    solver = inner_solver() if plan.system else ""
    known = {name: fit for (of, system, name), fit in MEASURED.items() if (of, system) == (kind, plan.system)}
    if not known:
        return None
    fits = [known[solver]] if solver in known else list(known.values())
    each = max(max(a + b * log2(points), 50.0) for a, b in fits)
    if solver == "light" and options.get("ksp_type", "gmres") == "gmres":
        unknowns = 2 if plan.system == "full" else 1
        given = options.get("ksp_gmres_restart", "")  # PETSc's default where it is no whole number, which PETSc itself refuses
        each += 8 * unknowns * min(int(given) if given.isdecimal() else 30, 200)
    if facts.lent and not plan.system and not facts.moving:
        each -= LENT[facts.alike]
    return (
        each * points + SPREAD[facts.moving] * facts.spread + TWICE[facts.spread > 0] * facts.twice * (facts.spread or points)
    )


def _libraries(facts: Facts, plan: Plan) -> int:
    """Bytes of what a rank loads in the course of such a run."""
    compiles = not plan.system or (plan.nested and plan.method in ("active-set", "monotone"))
    if facts.kind == "lubrication" and compiles and "numba" not in sys.modules and has_numba():
        return LIBRARIES + COMPILER
    return LIBRARIES


def check(facts: Facts, plan: Plan, comm: MPI.Comm, refuse: bool = True, before: int | None = None) -> Estimate | None:
    """The run's estimate. Collective.

    Parameters
    ----------
    plan : how the run goes; the options of its recipe are in force.
    refuse : whether a run that cannot fit is refused.
    before : `resident` before anything was built; default: as now.

    Raises
    ------
    InputError : on some machine the ranks need more than it has left.
    """
    needed = bytes_needed(facts, plan)
    if needed is None:
        return None
    before = resident() if before is None else before
    fixed = _libraries(facts, plan)
    base = comm.allreduce(before + fixed)
    if needed < LITTLE:
        return Estimate(base, base + int(needed))
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = (needed / comm.size + fixed) * machine.size
    built = machine.allreduce(resident() - before)  # part of what is needed, and no longer available
    left = machine.allreduce(available(), MPI.MIN) + built
    machine.Free()
    short, there = comm.allreduce((share > left, -left), MPI.MAX)
    if short and refuse:
        raise InputError(
            f"grid {'x'.join(map(str, facts.shape))}: {facts.size} points need about {_gb(needed)} GB with method {plan.method}"
            f"{f' on the {plan.system} system' if plan.system else ''}, {_gb(-there)} GB are available; "
            f"take fewer points, another method or --no-memory-check"
        )
    return Estimate(base, base + int(needed))


def _gb(size: float) -> str:
    return f"{size / 1e9:.0f}" if size >= 1e10 else f"{size / 1e9:.2g}"


def look_ahead(facts: Facts, plan: Plan, comm: MPI.Comm) -> None:
    """Refuse a large scene before it is built; others are checked once they are. Collective.

    Raises
    ------
    InputError : as `check`.
    """
    if LARGE <= facts.size <= np.iinfo(PETSc.IntType).max // 2:  # beyond that the grid refuses by itself
        with recipe(plan.recipe):
            check(facts, plan, comm)
