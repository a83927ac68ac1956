"""`lcp-lube doctor`: its report, its advice, and a verdict that follows from the self-check."""

import os
import subprocess

import pytest
from conftest import ENVIRONMENT
from mpi4py import MPI

from lcp_lube.cli import doctor

KEYS = {"versions", "solver_packages", "blas", "mpi", "mpiexec", "ranks", "cores", "memory_gb", "self_check", "ok", "advice"}


@pytest.mark.parametrize("ranks", [1, 3])
def test_it_reports_and_passes(cli, ranks):
    """On its own it starts a job of two ranks; in a job it takes two of its ranks."""
    run = cli("doctor", "--json", ranks=ranks, timeout=200)
    assert run.status == 0, run.out + run.err
    data = run.json
    assert not KEYS - set(data) and data["ok"] is True and data["ranks"] == ranks
    assert [(check["scene"], check["ranks"]) for check in data["self_check"]] == [
        (scene, n) for n in (1, 2) for scene in ("problem1", "problem4")
    ]
    assert all(check["passed"] for check in data["self_check"])
    assert {check["error"] < 2e-5 for check in data["self_check"] if "error" in check} == {True}


def test_the_last_line_is_the_verdict(capsys, monkeypatch):
    report = {**doctor.inspect(), "self_check": [], "ok": True, "advice": []}
    assert doctor.text_of(report).splitlines()[-1] == "the self-check passed, 0.0 s"
    checks = [{"scene": "problem1", "ranks": 2, "passed": False, "load": None, "message": "no luck"}]
    lines = doctor.text_of({**report, "self_check": checks, "ok": False}).splitlines()
    assert "self-check: problem1 on 2 ranks FAILED: no luck" in lines and lines[-1].startswith("the self-check FAILED")


def test_a_wrong_answer_fails_the_check(monkeypatch):
    """Nothing but the exact solution tells a wrong load from a right one."""
    from lcp_lube.problems.film.lubrication import LubricationProblem

    honest = LubricationProblem.quantities
    monkeypatch.setattr(
        LubricationProblem,
        "quantities",
        lambda self, fields: {**honest(self, fields), "pressure_integral": 1.01 * honest(self, fields)["pressure_integral"]},
    )
    problem1, _ = doctor.self_check(MPI.COMM_SELF)
    assert not problem1["passed"] and "load off by 1.0e-02" in problem1["message"]


def test_a_solver_that_raises_fails_the_check(monkeypatch):
    def solve(*_, **__):
        raise RuntimeError("out of order\nsecond line")

    monkeypatch.setattr(doctor, "solve", solve)
    assert [check["message"] for check in doctor.self_check(MPI.COMM_SELF)] == ["RuntimeError: out of order second line"] * 2


@pytest.mark.parametrize(
    "body, message",
    [
        ("echo no slots >&2; exit 3", "ended with status 3: no slots"),
        ("sleep 60", "had not ended after 1 s"),
        ("""echo '[{"scene": "problem1", "ranks": 1, "passed": true, "load": 1}]'""", "another MPI than mpi4py's"),
    ],
)
def test_a_broken_mpiexec_is_told(tmp_path, monkeypatch, body, message):
    fake = tmp_path / "mpiexec"
    fake.write_text(f"#!/bin/sh\n{body}\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(doctor, "LIMIT", 1.0)
    monkeypatch.setattr(doctor, "GRACE", 0.5)
    (check,) = doctor.two_ranks()
    assert not check["passed"] and message in check["message"]


def test_no_mpiexec(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert [check["message"] for check in doctor.two_ranks()] == ["there is no mpiexec on the path"]
    assert any(line.startswith("mpiexec: ") for line in doctor.advice(doctor.inspect()))


def test_advice_for_what_is_missing():
    report = doctor.inspect()
    bare = {
        **report,
        "solver_packages": dict.fromkeys(report["solver_packages"], False),
        "versions": {**report["versions"], "numba": None, "matplotlib": None},
        "blas": "/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.11.0",
        "omp_num_threads": "8",
        "petsc_numbers": "complex128, int32 indices",
    }
    text = "\n".join(doctor.advice(bare))
    for word in ("hypre", "mumps", "suitesparse", "hdf5", "numba", "matplotlib", "libopenblas0", "OMP_NUM_THREADS=8", "real"):
        assert word in text


def test_without_petsc_one_line_says_so(tmp_path):
    """A petsc4py that cannot be imported: no traceback."""
    import sys

    (tmp_path / "petsc4py.py").write_text("raise ImportError('libpetsc.so: cannot open shared object file')\n")
    environment = ENVIRONMENT | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ENVIRONMENT['PYTHONPATH']}"}
    done = subprocess.run(
        [sys.executable, "-m", "lcp_lube", "doctor"], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "PETSc for Python is needed" in done.stderr and "cannot open shared object file" in done.stderr
