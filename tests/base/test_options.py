"""Recipes and PETSc options: every one read, the user's before the recipe's, misspelt ones refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipes import attempt, faults, one_rank

from lcp_lube import InputError, load_scene, solve
from lcp_lube.base.options import check_unread, explain_error, known_names, recipe, set_names, unread
from lcp_lube.drivers.ask import Ask
from lcp_lube.drivers.plan import plan
from lcp_lube.registry import read_recipe, recipe_line, recipe_names


@pytest.mark.parametrize("name", recipe_names())
def test_every_option_of_a_recipe_is_read(name):
    """On a problem that it is for (tests/recipes.py), it also converges, unless its first line says that it fails."""
    assert faults(name, attempt(name)) == []


@pytest.mark.parametrize("name", [name for name in recipe_names() if not one_rank(name)])
def test_every_option_of_a_recipe_is_read_on_two_ranks(mpi_job, name):
    assert faults(name, mpi_job(2)["recipes"][name], ("converged", "max_iterations")) == []


@pytest.mark.parametrize("name", recipe_names())
def test_first_lines_say_what_and_when(name):
    line = recipe_line(name)
    assert len(line) > 30 and line.endswith(".")
    assert "rank" in line or "parallel" in line  # where it runs
    assert read_recipe(name) and all(key == key.strip("-") for key in read_recipe(name))


def test_an_unread_option_of_a_recipe_would_be_found(tmp_path, monkeypatch):
    """The test above can fail."""
    (tmp_path / "odd.opts").write_text("# Odd one; one rank.\n-ksp_type gmres\n-pc_type ilu\n-pc_factor_levls 2\n")
    monkeypatch.setattr("lcp_lube.registry.RECIPE_DIR", tmp_path)
    assert faults("odd", attempt("odd")) == ["option -pc_factor_levls goes unread"]


def run(recipe_name, **changes):
    solution = solve(
        load_scene("problem1", {"n": 12, **changes}), method="din", system="full", recipe=recipe_name, nested=False
    )
    solution.destroy()
    return solution


@pytest.mark.parametrize(
    "name, options, expected",
    [
        ("gmres_ilu", {"ksp_type": "bcgs"}, ("bcgs", "ilu", "gmres_ilu but -ksp_type bcgs")),
        ("mumps", {"pc_type": "jacobi", "ksp_type": "gmres"}, ("gmres", "jacobi", "mumps but -ksp_type gmres -pc_type jacobi")),
        ("mumps", {"ksp_type": "gmres"}, ("gmres", "lu", "mumps but -ksp_type gmres")),
        ("mumps", {"pc_type": "lu"}, ("preonly", "lu", "mumps")),
        ("gmres_ilu", {"ksp_rtol": "1e-3"}, ("gmres", "ilu", "gmres_ilu")),
        (None, {"pc_type": "lu"}, ("gmres", "lu", None)),
    ],
)
def test_the_users_options_win(petsc_options, name, options, expected):
    petsc_options(**options)
    settings = run(name).settings
    assert (settings["ksp_type"], settings["pc_type"], settings["recipe"]) == expected
    check_unread()
    assert set_names() == set(options)


def test_another_factorisation_package_wins(petsc_options):
    """The recipe's options for its own package would go unread."""
    petsc_options(pc_factor_mat_solver_type="superlu")
    solution = run("mumps")
    assert solution.converged and solution.settings["recipe"] == "mumps but -pc_factor_mat_solver_type superlu"
    check_unread()


def test_a_recipe_leaves_nothing_behind():
    with recipe("mumps") as name:
        assert name == "mumps" and set_names() == set(read_recipe("mumps"))
    assert set_names() == set()
    with pytest.raises(ZeroDivisionError), recipe("lu"):
        raise ZeroDivisionError
    assert set_names() == set()
    with recipe(None) as name:
        assert name is None and set_names() == set()


@pytest.mark.parametrize("name, near", [("mump", "; nearest is mumps"), ("gmres-ilu", "; nearest is gmres_ilu"), ("", "")])
def test_unknown_recipe(name, near):
    with pytest.raises(InputError, match=f"^--recipe {name}: no such recipe{near}; see 'lcp-lube list'$"), recipe(name):
        pass


@pytest.mark.parametrize("name", ["ksp_type", "ksp_rtol", "ksp_max_it", "pc_factor_levels", "sub_pc_type"])
def test_an_option_without_its_value(petsc_options, name):
    """PETSc would take its default in silence."""
    petsc_options(**{name: None})
    with pytest.raises(InputError, match=f"^-{name}: a value is needed$"):
        run("lu")


@pytest.mark.parametrize(
    "name, nearest",
    [
        ("ksp_typ", "-ksp_type"),
        ("pc_factor_level", "-pc_factor_levels"),
        ("log_viw", "-log_view"),
        ("options_lef", "-options_left"),
        ("mat_mumps_icntl_114", "-mat_mumps_icntl_14"),
    ],
)
def test_unread_options_are_refused_with_the_nearest_name(petsc_options, name, nearest):
    petsc_options(**{name: "1"})
    assert unread() == [name]
    with pytest.raises(InputError, match=f"^-{name}: no solver in this run reads this option; nearest is {nearest}$"):
        check_unread()


def test_an_option_that_exists_but_that_nobody_reads(petsc_options):
    petsc_options(ksp_type="gmres", pc_type="jacobi", pc_factor_levels=2)
    run(None)
    with pytest.raises(InputError, match=r"^-pc_factor_levels: no solver in this run reads this option"):
        check_unread()


@pytest.mark.parametrize("name", ["log_view", "options_left", "malloc_dump", "memory_view", "objects_dump", "citations"])
def test_options_read_at_the_end_are_not_unread(petsc_options, name):
    petsc_options(**{name: None})
    check_unread()


def test_known_names_hold_the_recipes():
    known = set(known_names())
    assert all(set(read_recipe(name)) <= known for name in recipe_names())


@given(st.text())
def test_any_error_is_told_in_one_line(text):
    line = explain_error(Exception(text))
    assert line and len(line.splitlines()) == 1


@pytest.mark.parametrize("name", ["ksp_monitor", "ksp_view", "pc_factor_shift_type", "mat_type", "mat_mumps_icntl_14"])
def test_an_option_of_a_ksp_is_a_wish_for_one(petsc_options, name):
    """Nonlinear multigrid, which solves no linear system, is not what 'auto' takes then."""
    facts = load_scene("problem4", {"n": 120}).facts()
    chosen = [plan(facts, Ask(), "problem4").method]
    petsc_options(**{name: "dense" if name == "mat_type" else None})
    chosen.append(plan(facts, Ask(), "problem4").method)
    assert chosen == ["fas", "active-set"]


@pytest.mark.parametrize("system", ["full", "reduced"])
def test_dense_matrices_by_lapack(petsc_options, system):
    sparse = solve("problem4", n=9, system=system)
    petsc_options(mat_type="dense")
    dense = solve("problem4", n=9, system=system)
    assert sparse.converged and dense.converged and dense.settings["recipe"] == "dense_lu"
    np.testing.assert_allclose(dense.fields["p"], sparse.fields["p"], rtol=1e-10, atol=1e-12)
    for solution in (sparse, dense):
        solution.destroy()


@pytest.mark.parametrize("kind, recipe_name", [("dense", "superlu"), ("sbaij", None)])
def test_a_matrix_type_that_does_not_fit_is_named(petsc_options, kind, recipe_name):
    petsc_options(mat_type=kind)
    with pytest.raises(InputError, match=f"^-mat_type {kind}: PETSc: .* without this option the matrix is aij$"):
        solve("problem1", n=20, recipe=recipe_name)
