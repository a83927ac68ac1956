"""The registry: every name leads to code, and naming costs no PETSc."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import lcp_lube
from lcp_lube import registry


@pytest.mark.parametrize("table", ["METHODS", "SYSTEMS", "FAMILIES"])
def test_every_name_leads_to_code_and_has_a_line(table):
    for name, entry in getattr(registry, table).items():
        assert callable(entry.load()), name
        assert 10 < len(entry.line) < 120 and not entry.line.endswith("."), name


def test_methods_name_existing_systems_and_kinds():
    kinds = {kind for entry in registry.METHODS.values() for kind in entry.kinds}
    assert set(registry.DEFAULT_METHOD) <= kinds
    for kind, name in registry.DEFAULT_METHOD.items():
        assert kind in registry.METHODS[name].kinds
    for name, entry in registry.METHODS.items():
        assert entry.kinds and (entry.systems or name in ("fas", "pivoting")), name  # no linear systems, or its own
        if "lubrication" in entry.kinds:
            assert set(entry.systems) <= set(registry.SYSTEMS), name


def test_recipes_are_found_where_they_stand():
    assert {"lu", "superlu", "mumps", "gmres_ilu", "bcgs_ilu", "bjacobi"} <= set(registry.recipe_names())
    assert registry.read_recipe("mumps")["pc_factor_mat_solver_type"] == "mumps"
    assert registry.recipe_line("lu").startswith("LAPACK")


def test_a_wheel_holds_every_package_scene_and_recipe():
    """What pyproject.toml lists is what there is; recipes stand at top level and go into the package."""
    root = Path(lcp_lube.__file__).parent.parent
    tool = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]
    packages = {path.parent.relative_to(root) for path in root.glob("lcp_lube/**/__init__.py")}
    assert {".".join(path.parts) for path in packages} <= set(tool["packages"])
    assert {"lcp_lube.scenes", "lcp_lube.options"} <= set(tool["packages"])
    assert tool["package-dir"]["lcp_lube.options"] == "options" and "*.opts" in tool["package-data"]["lcp_lube.options"]
    assert "*.toml" in tool["package-data"]["lcp_lube.scenes"]


def test_recipe_syntax(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "RECIPE_DIR", tmp_path)
    (tmp_path / "a.opts").write_text("# What; one rank.\n\n  -ksp_type gmres # why\n-flag\n-pair  a  b \n")
    assert registry.read_recipe("a") == {"ksp_type": "gmres", "flag": "", "pair": "a  b"}
    assert registry.recipe_names() == ["a"] and registry.recipe_line("a") == "What; one rank."


def test_import_starts_neither_petsc_nor_mpi():
    """So that a program may still call petsc4py.init(argv) first, which is a silent no-op once PETSc runs."""
    code = (
        "import sys, lcp_lube, lcp_lube.cli.arguments, lcp_lube.registry, lcp_lube.errors, lcp_lube.__main__\n"
        "lcp_lube.cli.arguments.parse(['solve', 'problem1'])\n"
        "sys.exit(any(name in sys.modules for name in ('petsc4py.PETSc', 'mpi4py.MPI', 'numpy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_public_names():
    for name in lcp_lube.__all__:
        assert getattr(lcp_lube, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nope'"):
        _ = lcp_lube.nope
