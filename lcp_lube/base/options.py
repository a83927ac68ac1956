"""PETSc options: recipes from files, what nobody read, and errors in one line with the nearest legal name."""

import ctypes
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from ..errors import InputError, nearest
from ..registry import read_recipe, recipe_names

# Read by PETSc at its end.
LATE = {"log_view", "options_left", "options_view", "malloc_dump", "malloc_view", "memory_view", "objects_dump", "citations"}
# Options that mean nothing without a value: PETSc takes its default in silence.
VALUED = re.compile(r"(_type|_[ard]tol|divtol|_max_it|_levels|_restart|_overlap|_omega|_its|_blocks|_icntl_\d+|_pcs)$")
# Options that only a linear solver reads: giving one selects a method that has one.
LINEAR = re.compile(r"ksp_|pc_|sub_|mg_|fieldsplit_|redundant_|mat_(type|mumps_|superlu|umfpack_|solver)")
# What later releases call an option of the recipes; the old name still works there, with a warning.
RENAMED = {"ksp_gmres_modifiedgramschmidt": ((3, 26), "ksp_orthogonalization", "mgs")}
# What PETSc says of a word that it does not know.
KINDS = (
    (r"requested (KSP type) (\S+)", PETSc.KSP.Type),
    (r"requested (PC type) (\S+)", PETSc.PC.Type),
    (r"Unknown ([Mm]at type) given: (\S+)", PETSc.Mat.Type),
    (r"locate (solver type) (\S+)", PETSc.Mat.SolverType),
)


def set_names() -> set[str]:
    """Names of all options that are set, without their dash."""
    return set(PETSc.Options().getAll())


def wants_ksp() -> bool:
    """Whether an option is set that only a KSP, its preconditioner or its matrix reads: -ksp_monitor, -mat_type dense."""
    return any(LINEAR.match(name) for name in set_names())


@contextmanager
def recipe(name: str | None) -> Iterator[str | None]:
    """Set a recipe's options for the duration, except those that the user gave; yields its name with the user's changes.

    A user's -ksp_type, -pc_type or -pc_factor_mat_solver_type that differs replaces all that the recipe says of that part:
    its options for it would go unread or clash.

    Raises
    ------
    InputError : no such recipe, or a user's option that lacks its value.
    """
    options = PETSc.Options()
    user = options.getAll()
    for key, value in user.items():
        if not value and VALUED.search(key):
            raise InputError(f"-{key}: a value is needed")
    given = set(user)
    own = _renamed(read_recipe(name)) if name is not None else {}
    chosen = own
    parts = {
        "ksp_type": lambda key: key.startswith("ksp_"),
        "pc_type": lambda key: not key.startswith("ksp_"),
        "pc_factor_mat_solver_type": lambda key: key.startswith("mat_mumps_"),
    }
    for leader, belongs in parts.items():
        if leader in user and user[leader] != chosen.get(leader):
            chosen = {key: value for key, value in chosen.items() if not belongs(key)}
    added = [key for key in chosen if key not in given]
    changed = " ".join(f"-{key} {user[key]}" for key in own if key in user and user[key] != own[key])
    for key in added:
        options.setValue(key, chosen[key] or None)
    try:
        yield f"{name} but {changed}" if changed else name
    finally:
        for key in added:
            options.delValue(key)


def _renamed(options: Mapping[str, str]) -> dict[str, str]:
    """Options by their names in this release of PETSc."""
    version = PETSc.Sys.getVersion()
    later = {old: (new, value) for old, (since, new, value) in RENAMED.items() if version >= since}
    return dict(later.get(name, (name, value)) for name, value in options.items())


def unread() -> list[str]:
    """Names of the options that are set and that nobody has asked for yet.

    petsc4py 3.18 does not offer this; the C function behind PETSc's own -options_left does.
    """
    library = ctypes.CDLL(PETSc.__file__)
    count, names, values = ctypes.c_int64(0), ctypes.POINTER(ctypes.c_char_p)(), ctypes.POINTER(ctypes.c_char_p)()
    library.PetscOptionsLeftGet(None, ctypes.byref(count), ctypes.byref(names), ctypes.byref(values))
    left = [names[i].decode() for i in range(count.value)]
    library.PetscOptionsLeftRestore(None, ctypes.byref(count), ctypes.byref(names), ctypes.byref(values))
    return [name for name in left if name not in LATE]


def check_unread() -> None:
    """Raise InputError if an option was not read by now."""
    left = unread()
    if left:
        near = "" if left[0] in known_names() else nearest(left[0], known_names(), "-")
        raise InputError(f"-{left[0]}: no solver in this run reads this option{near}")


def known_names() -> list[str]:
    """Option names to propose: those of the recipes and the usual ones."""
    usual = """ksp_type ksp_rtol ksp_atol ksp_divtol ksp_max_it ksp_norm_type ksp_pc_side ksp_gmres_restart ksp_monitor
        ksp_monitor_true_residual ksp_view ksp_converged_reason ksp_initial_guess_nonzero ksp_gmres_modifiedgramschmidt
        ksp_bcgsl_ell ksp_richardson_scale pc_type pc_factor_levels pc_factor_fill pc_factor_mat_ordering_type
        pc_factor_mat_solver_type pc_factor_shift_type pc_factor_zeropivot pc_bjacobi_blocks pc_asm_overlap pc_sor_omega
        pc_sor_its pc_hypre_type pc_hypre_boomeramg_strong_threshold pc_hypre_boomeramg_coarsen_type
        pc_hypre_boomeramg_interp_type pc_hypre_boomeramg_relax_type_all pc_gamg_type pc_gamg_threshold pc_mg_levels
        pc_fieldsplit_type pc_fieldsplit_schur_fact_type pc_fieldsplit_schur_precondition pc_python_type pc_composite_pcs
        ksp_python_type pc_ainv_drop pc_ainv_block pc_fsai_power cimmino_partition cimmino_blocks
        sub_ksp_type sub_pc_type sub_pc_factor_levels sub_pc_factor_mat_solver_type mat_type mat_view log_view
        mat_mumps_icntl_14 mat_mumps_icntl_4 options_left options_file options_view""".split()  # noqa: SIM905
    return sorted({*usual, *(key for name in recipe_names() for key in read_recipe(name))})


def explain_error(error: PETSc.Error) -> str:
    """One line from PETSc's traceback that names the option, where it can be identified, and the nearest legal value."""
    lines = [re.sub(r"^\[\d+\]\s*", "", line).strip() for line in str(error).splitlines()]
    text = next((line for line in reversed(lines) if line and not re.match(r"^\w+\(\) (line|at)", line)), str(error))
    given = PETSc.Options().getAll()

    def option(value: str) -> str:
        return next((f"-{key} {value}" for key, set_to in given.items() if set_to == value), value)

    if "-pc_python_type [package.]" in text:
        return "-pc_type python: -pc_python_type MODULE.CLASS is needed too"
    if found := re.search(r"Unknown option \"?(\S+?)\"? for (-\S+)\. Available options: (.*)", text):
        legal = found[3].split()
        return f"{found[2]} {found[1]}: allowed are {', '.join(legal)}{nearest(found[1], legal)}"
    if found := re.search(r"factorization type (\S+) and matrix type mpi", text):
        other = "recipe bjacobi has one inside each rank" if found[1] in ("ILU", "ICC") else "recipes mumps and superlu_dist do"
        return f"PETSc has no {found[1]} of its own for several ranks; the {other}"
    if found := re.search(r"MatSolverType (\S+) does not support matrix type mpi", text):
        return f"{option(found[1])}: for one rank only; for several there are the recipes mumps and superlu_dist"
    for pattern, enum in KINDS:
        if found := re.search(pattern, text):
            word = found[2].rstrip(".,")
            legal = [value for key, value in vars(enum).items() if not key.startswith("_")]
            return f"{option(word)}: no such {found[1]} in this PETSc{'' if word in legal else nearest(word, legal)}"
    words = set(re.findall(r"[a-z]{4,}", text.lower()))
    if (kind := given.get("mat_type", "aij")) != "aij" and re.search(r"matrix type|[Mm]atrix must be", text):
        text = text.rstrip(".")
        return f"-mat_type {kind}: PETSc: {text}; without this option the matrix is aij"
    culprit = next(
        (
            f"-{key} {value}: "
            for key, value in given.items()
            if value and (value in text.split() or value.lstrip(":") in text.split() or words & set(key.split("_")))
        ),
        "",
    )
    return f"{culprit}PETSc: {text}"
