"""Under mpiexec: the serial test on 2 and 3 ranks with awkward sizes; refusals are said once."""

import numpy as np
import pytest
from mpi4py import MPI
from mpi_job import DIRECT, ITERATIVE, run
from petsc4py import PETSc

from lcp_lube.base.parallel import Reduce

RANKS = [2, 3]


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", DIRECT)
def test_direct_solvers_make_the_same_run_on_any_number_of_ranks(mpi_job, name, ranks):
    """it, back, cent equal; fields equal to 1e-10."""
    serial, fields = run(*DIRECT[name])
    parallel = mpi_job(ranks)
    assert serial["outcome"] == "converged"
    assert parallel[name]["outcome"] == "converged", parallel[name]["message"]
    assert parallel[name]["counts"] == serial["counts"]
    for field, values in fields.items():
        np.testing.assert_allclose(parallel["fields"][f"{name}_{field}"], values, rtol=0, atol=1e-10 * np.abs(values).max())
    for quantity in {"load", "friction", "p_max", "cavitated_fraction", "rupture", "reformation"} & set(serial):
        expected = serial[quantity] if serial[quantity] is None else pytest.approx(serial[quantity], rel=1e-9)
        assert parallel[name][quantity] == expected, quantity
    assert parallel[name]["unread"] == []


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", ITERATIVE)
def test_iterative_solvers_come_to_the_same_answer(mpi_job, name, ranks):
    serial, _ = run("problem4", {"nx": 23, "ny": 17}, "din", name, ITERATIVE[name])
    parallel = mpi_job(ranks)[name]
    assert serial["outcome"] == parallel["outcome"] == "converged"
    for quantity in ("p_max", "load", "friction"):
        assert parallel[quantity] == pytest.approx(serial[quantity], rel=1e-6)


def refusal(run):
    assert run.status == 2 and run.out == ""
    assert len(run.lines) == 1 and run.lines[0].startswith("lcp-lube: "), run.err
    return run.lines[0]


@pytest.mark.parametrize(
    "words, message",
    [
        ("problem1 --n 1", "grid 1: too few points for 2 ranks; use fewer ranks or a finer grid"),
        ("problem1 --set h_min=-1", "problem1: h_min = -1: allowed is greater than 0"),
        (
            "problem1 --n 20 --method din -ksp_type gmres -pc_type ilu",
            "PETSc has no ILU of its own for several ranks; the recipe bjacobi has one inside each rank",
        ),
        ("problem1 --n 20 -ksp_typ gmres", "-ksp_typ: no solver in this run reads this option; nearest is -ksp_type"),
        ("problem1 --n 20 --recipe superlu", "-pc_factor_mat_solver_type superlu: for one rank only"),
        pytest.param(
            "problem1 --n 20 --system full --recipe lu",
            "PETSc has no LU of its own for several ranks; the recipes mumps",
            marks=pytest.mark.skipif(PETSc.Sys.getVersion() > (3, 19), reason="newer releases have a parallel dense LU"),
        ),
    ],
)
def test_refusals_are_said_once(cli, words, message):
    assert message in refusal(cli("solve", *words.split(), ranks=2))


def test_json_is_printed_once(cli):
    run = cli("solve", "problem4", "--nx", 7, "--ny", 5, "--json", ranks=2)
    assert run.status == 0 and run.json["ranks"] == 2 and run.json["converged"]


def test_reductions_on_one_rank():
    reduce = Reduce(MPI.COMM_SELF)
    a = np.array([3.0, -4.0])
    assert (reduce.sum(a), reduce.dot(a, a), reduce.norm(a), reduce.min(a), reduce.max(a)) == (-1, 25, 5, -4, 3)
    assert reduce.norm(a, np.array([12.0])) == 13
    empty = np.empty(0)
    assert (reduce.sum(empty), reduce.norm(empty), reduce.min(empty), reduce.max(empty)) == (0, 0, np.inf, -np.inf)
    assert np.isnan(reduce.min(np.array([1, np.nan]))) and np.isnan(reduce.max(np.array([np.nan, 1])))
