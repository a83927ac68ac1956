"""What to run when the user does not say: method, system, recipe and nested iteration, with the reasons."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from petsc4py import PETSc

from ..base.compiled import has_numba
from ..base.options import set_names, wants_ksp
from ..errors import InputError, nearest
from ..problems.facts import Facts
from ..registry import DEFAULT_METHOD, METHODS, SMALL, SMALL_BOX
from .ask import Ask

# Points up to which a film in 2D is solved directly in less time than it takes to load multigrid's compiled loops, and right to
# the last digits at any film ratio: a process's first solve takes 0.06 to 0.08 s of it, by multigrid 0.55 s. The rule looks at
# the points alone, not at what the process has loaded: a scene is always solved in the same way. Programs that go on say
# `direct_below=0`: of films of nine shapes with 7 to 99 points a side multigrid then takes 0.4 to 1 of the direct solve's time.
FEW = 10_000
SMALL_RING = 200_000  # points up to which the active set's system is solved directly in a film that is periodic along the flow
DIN_ONLY = {"r0", "mu", "conditions"}  # flags that only an interior method has a use for


@dataclass(frozen=True)
class Plan:
    """The choices of one run; `why` has a sentence for each that was not the user's."""

    method: str
    system: str
    recipe: str | None
    nested: bool
    why: list[str] = field(default_factory=list)


def plan(facts: Facts, ask: Ask, scene: str) -> Plan:
    """Fill in what was left to us; nothing is built for it.

    Raises
    ------
    InputError : a name that does not exist, or does not fit the scene or the method.
    """
    method, system, recipe, nested, options = ask.method, ask.system, ask.recipe, ask.nested, ask.options
    why = []
    if method == "auto":
        method = DEFAULT_METHOD[facts.kind]
        no_linear = system == "auto" and recipe is None and not nested and not options
        why_direct = ""
        if method == "active-set" and no_linear and _suits_multigrid(facts, lines=ask.direct_below == 0):
            few = FEW if ask.direct_below is None else ask.direct_below
            if facts.size > few:
                method = "fas"
            else:
                why_direct = f"; {few} points and fewer are solved sooner than multigrid's loops are loaded"
        reason = METHODS[method].of(facts.kind).line + why_direct
        if facts.kind == "lubrication" and DIN_ONLY & set(options):
            method, reason = "din", f"{', '.join(sorted(DIN_ONLY & set(options)))} are its options"
        why.append(f"method {method}: {reason}")
    entry = METHODS[_known(method, METHODS, "--method")]
    if facts.kind in entry.kinds:
        entry = entry.of(facts.kind)
    else:
        fitting = [name for name, other in METHODS.items() if facts.kind in other.kinds]
        raise InputError(f"--method {method}: not for scene {scene}; allowed are {', '.join(fitting)}")
    if facts.size > entry.at_most:
        raise InputError(f"--method {method}: for at most {entry.at_most} points, scene {scene} has {facts.size}")
    if not entry.systems:
        for option, given in (("--system", None if system == "auto" else system), ("--recipe", recipe)):
            if given is not None:
                raise InputError(f"{option} {given}: method {method} solves no linear systems")
        if nested:
            raise InputError(f"--nested: method {method} has grids of its own")
        return Plan(method, "", None, False, why)
    small = SMALL_BOX if facts.kind == "box" else SMALL
    if facts.kind == "lubrication" and facts.periodic[0]:
        small = SMALL_RING  # what feeds the film is a small part of what goes round: its balance needs digits
    large = facts.dim == 2 and facts.size > small
    if system == "auto":
        system = entry.systems[0]
        whole = facts.whole_lines and not any(facts.periodic) and not facts.held and not facts.moving
        if large and "cavity" in entry.systems and whole:
            system = "cavity"
            why.append(
                "system cavity: with the cavitated cells eliminated and its near-null vector scaled out, multigrid holds"
            )
    _known(system, entry.systems, f"method {method}: --system")
    if nested is None:
        own_start = entry.interior and bool({"p0", "r0"} & set(options))  # one that someone chose is to be used
        # The front of a steady line is known by sums (`line_start`).
        known = method == "active-set" and facts.dim == 1 and not (facts.periodic[0] or facts.held or facts.moving)
        nested = entry.nested and facts.size > entry.nested_above and not own_start and not known
        if nested:
            why.append("nested: the front found on a coarser grid leaves a few steps on this one")
    elif nested and not entry.nested:
        raise InputError(f"--nested: method {method} does not start from a coarser grid")
    if recipe is None and {"ksp_type", "pc_type"}.isdisjoint(set_names()):  # else no inner solver of ours is wanted
        recipe, reason = default_recipe(facts, system, large)
        why.append(f"recipe {recipe}: {reason}")
    return Plan(method, system, recipe, nested, why)


def _suits_multigrid(facts: Facts, lines: bool) -> bool:
    """Whether nonlinear multigrid is the fastest: in 2D, or on lines where that is said, its loops compiled, nobody having
    asked for an inner solver."""
    return facts.kind == "lubrication" and (facts.dim == 2 or lines) and has_numba() and not wants_ksp()


def default_recipe(facts: Facts, system: str, large: bool) -> tuple[str, str]:
    """The inner solver that this PETSc has for this system, size and number of ranks, and why."""
    has, dense = PETSc.Sys.hasExternalPackage, "dense" in PETSc.Options().getAll().get("mat_type", "")
    if facts.kind in ("lubrication", "equations") and system != "full" and large:
        reason = "a large 2D M-matrix: multigrid costs the same per point on every grid"
        if has("hypre"):
            return "bcgs_amg", reason
        if system == "cavity":  # its scaling is what the other multigrids need
            return ("bcgs_ml" if has("ml") else "bcgs_gamg"), f"{reason}; this PETSc has no hypre, whose is the fastest"
    if facts.kind == "box" and large:
        return "multigrid", "a large problem with coarser grids: multigrid costs the same per point on every grid"
    ranks = facts.ranks
    if facts.dense or dense:
        return ("redundant_lu" if ranks > 1 else "dense_lu"), "a dense Jacobian: LAPACK"
    if facts.dim == 1 and system == "reduced" and ranks == 1:
        return "banded", "tridiagonal, an M-matrix: elimination in natural order, without pivoting or fill"
    film = facts.kind == "lubrication" and facts.dim == 2 and not any(facts.periodic)
    if film and system == "reduced" and ranks == 1 and facts.size <= FEW:
        return "dissection", "an M-matrix of few points: elimination without pivoting, in nested dissection order"
    names = ("mumps", "superlu_dist") if ranks > 1 else ("superlu", "umfpack", "mumps")
    if facts.dim == 2 and ranks == 1:
        names = ("umfpack", "superlu", "mumps")
    for name in names:
        if has(name) or (name == "umfpack" and has("suitesparse")):  # its name in older releases
            return name, f"a direct solver that this PETSc has for {ranks} rank{'s' * (ranks > 1)}"
    return "bjacobi", "this PETSc has no parallel direct solver"


def _known(name: str, legal: Iterable[str], option: str) -> str:
    if name not in legal:
        raise InputError(f"{option} {name}: allowed are auto, {', '.join(legal)}{nearest(name, legal)}")
    return name
