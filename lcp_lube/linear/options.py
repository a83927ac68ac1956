"""PETSc options: recipes from files, what nobody read, and errors in one line with the nearest legal name."""

import ctypes
import re
from collections.abc import Iterator
from contextlib import contextmanager

import petsc4py
from petsc4py import PETSc

from ..errors import InputError, nearest
from ..registry import read_recipe, recipe_names

# Read by PETSc at its end, or by its start-up without being marked.
LATE = ("log_view", "log_", "options_left", "malloc", "help", "on_error", "objects_dump", "citations", "memory_view")


def set_names() -> set[str]:
    """Names of all options that are set, without their dash."""
    return set(PETSc.Options().getAll())


@contextmanager
def recipe(name: str | None) -> Iterator[None]:
    """Set a recipe's options for the duration, but for those that the user gave.

    A user's -pc_type replaces the recipe's preconditioner whole: the recipe's options for it would go unread or clash.
    """
    given = set_names()
    chosen = read_recipe(name) if name else {}
    if "pc_type" in given:
        chosen = {key: value for key, value in chosen.items() if key.startswith("ksp_")}
    if "ksp_type" in given:
        chosen = {key: value for key, value in chosen.items() if not key.startswith("ksp_")}
    options = PETSc.Options()
    added = [key for key in chosen if key not in given]
    for key in added:
        options.setValue(key, chosen[key] or None)
    try:
        yield
    finally:
        for key in added:
            options.delValue(key)


def unread() -> list[str]:
    """Names of the options that are set and that nobody has asked for yet.

    petsc4py 3.18 does not offer this; the C function behind PETSc's own -options_left does.
    """
    library = ctypes.CDLL(PETSc.__file__)
    count, names, values = ctypes.c_int64(0), ctypes.POINTER(ctypes.c_char_p)(), ctypes.POINTER(ctypes.c_char_p)()
    library.PetscOptionsLeftGet(None, ctypes.byref(count), ctypes.byref(names), ctypes.byref(values))
    left = [names[i].decode() for i in range(count.value)]
    library.PetscOptionsLeftRestore(None, ctypes.byref(count), ctypes.byref(names), ctypes.byref(values))
    return [name for name in left if not name.startswith(LATE)]


def check_unread() -> None:
    """Raise InputError if an option was not read by now.

    Raises
    ------
    InputError : names the option and the nearest one that exists.
    """
    left = unread()
    if left:
        raise InputError(f"-{left[0]}: no solver in this run reads this option{nearest(left[0], known_names(), '-')}")


def known_names() -> list[str]:
    """Option names to propose: those of the recipes and the usual ones."""
    usual = """ksp_type ksp_rtol ksp_atol ksp_divtol ksp_max_it ksp_norm_type ksp_pc_side ksp_gmres_restart ksp_monitor
        ksp_monitor_true_residual ksp_view ksp_converged_reason ksp_initial_guess_nonzero ksp_gmres_modifiedgramschmidt
        ksp_bcgsl_ell ksp_richardson_scale pc_type pc_factor_levels pc_factor_fill pc_factor_mat_ordering_type
        pc_factor_mat_solver_type pc_factor_shift_type pc_factor_zeropivot pc_bjacobi_blocks pc_asm_overlap pc_sor_omega
        pc_sor_its pc_hypre_type pc_hypre_boomeramg_strong_threshold pc_hypre_boomeramg_coarsen_type
        pc_hypre_boomeramg_interp_type pc_hypre_boomeramg_relax_type_all pc_gamg_type pc_gamg_threshold pc_mg_levels
        pc_fieldsplit_type pc_fieldsplit_schur_fact_type pc_fieldsplit_schur_precondition pc_python_type pc_composite_pcs
        sub_ksp_type sub_pc_type sub_pc_factor_levels sub_pc_factor_mat_solver_type mat_type mat_view log_view
        mat_mumps_icntl_14 mat_mumps_icntl_4 options_left options_file options_view""".split()  # noqa: SIM905
    return sorted({*usual, *(key for name in recipe_names() for key in read_recipe(name))})


def explain_error(error: PETSc.Error) -> str:
    """One line from PETSc's traceback; an unknown type gets the nearest legal one."""
    lines = [re.sub(r"^\[\d+\]\s*", "", line).strip() for line in str(error).splitlines()]
    text = next((line for line in reversed(lines) if line and not re.match(r"^\w+\(\) (line|at)", line)), str(error))
    kinds = (
        (r"KSP type (\S+)", PETSc.KSP.Type),
        (r"PC type (\S+)", PETSc.PC.Type),
        (r"[Mm]at(?:rix)? type (\S+)", PETSc.Mat.Type),
        (r"solver type (\S+)", PETSc.Mat.SolverType),
    )
    for pattern, enum in kinds:
        found = re.search(pattern, text)
        legal = [value for key, value in vars(enum).items() if not key.startswith("_")]
        if found and found[1].rstrip(".,") not in legal:
            text += nearest(found[1].rstrip(".,"), legal)
    return f"PETSc: {text}"


def petsc_version() -> str:
    return f"PETSc {'.'.join(map(str, PETSc.Sys.getVersion()))}, petsc4py {petsc4py.__version__}"
