"""`lcp-lube doctor`: what is installed, what is missing and how to get it, and a self-check on one and on two ranks."""

import argparse
import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

from .. import __version__
from ..api import solve
from ..base.progress import Line
from ..base.ranks import begin, cores
from ..base.together import all_come
from ..output.console import say
from ..output.table import table
from ..scenes.scene import load_scene

PACKAGES = ("mumps", "superlu", "superlu_dist", "suitesparse", "hypre", "ml", "scalapack", "ptscotch", "metis", "hdf5")
PYTHON_PACKAGES = ("petsc4py", "mpi4py", "numpy", "scipy", "pydantic", "numba", "matplotlib")
CHECKS: dict[str, dict[str, Any]] = {"problem1": {"n": 400, "scheme": "face"}, "problem4": {"n": 150}}
LOAD_TOL = 1e-4  # of problem 1 against its exact solution; its discretisation error is 1.2e-5
RANKS_TOL = 1e-6  # of a load on two ranks against that on one
LIMIT = 90.0  # seconds for the job of two ranks, which takes two on a machine that is free
GRACE = 10.0  # seconds that it has to end its ranks
ALONE = 20.0  # seconds that a rank which failed waits for the others
# What a job started from here needs: root may start it, and two ranks may share a core (Open MPI 4 and 5).
MAY_START = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMP_NUM_THREADS": "1",
}


def run(args: argparse.Namespace) -> int:
    """The command; 0 if the self-check passes, else 1. Collective."""
    report = inspect()
    report["self_check"] = checks = self_checks()
    report["ok"] = ok = all(check["passed"] for check in checks)
    report["advice"] = advice(report)
    say(json.dumps(report) if args.json else text_of(report))
    return 0 if ok else 1


def inspect() -> dict[str, Any]:
    """Versions, libraries and resources of this process."""
    has = PETSc.Sys.hasExternalPackage
    return {
        "versions": {
            "lcp_lube": __version__,
            "python": platform.python_version(),
            "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
            **{name: _version(name) for name in PYTHON_PACKAGES},
        },
        "petsc_numbers": f"{PETSc.ScalarType().dtype}, {PETSc.IntType().dtype} indices",
        # Newer releases of PETSc name SuiteSparse by its parts.
        "solver_packages": {name: bool(has(name) or (name == "suitesparse" and has("umfpack"))) for name in PACKAGES},
        "blas": blas(),
        "mpi": re.split(r"[,\n]", MPI.Get_library_version().strip("\0 "))[0].strip(),
        "mpiexec": shutil.which("mpiexec"),
        "ranks": MPI.COMM_WORLD.size,
        "cores": cores(),
        "omp_num_threads": os.environ.get("OMP_NUM_THREADS"),
        "memory_gb": round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9, 1),
    }


def blas() -> str | None:
    """The file of the BLAS that PETSc is linked with, as this process has it loaded (Linux); None if it cannot be told."""
    try:
        mapped = {line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if ".so" in line}
    except OSError:
        return None
    # NumPy's and SciPy's wheels carry one of their own, which PETSc does not use.
    found = [path for path in mapped if re.search(r"/lib(\w*blas\w*|mkl_rt)[.\-]", path) and ".libs/" not in path]
    return min(found, key=lambda path: ("openblas" not in path and "mkl" not in path, path), default=None)


def self_checks() -> list[dict[str, Any]]:
    """One rank by itself, then two: this job's first two, or a job of their own. The same list on every rank. Collective."""
    world = MPI.COMM_WORLD
    with Line() as line:
        line("sweep", "self-check on one rank", 0.0)
        checks = self_check(MPI.COMM_SELF) if world.rank == 0 else []
        line("sweep", "self-check on two ranks", 0.4)
        if world.size == 1:
            checks += two_ranks()
    if world.size > 1:
        pair = world.Split(0 if world.rank < 2 else MPI.UNDEFINED, world.rank)
        if pair != MPI.COMM_NULL:
            checks += self_check(pair)
            pair.Free()
    loads = {check["scene"]: check["load"] for check in checks if check["ranks"] == 1}
    for check in checks:
        one = loads.get(check["scene"])
        if check["passed"] and check["ranks"] == 2 and one and not abs(check["load"] / one - 1) <= RANKS_TOL:
            check |= {"passed": False, "message": f"load {check['load']:.10g} on two ranks, {one:.10g} on one"}
    return world.bcast(checks)


def self_check(comm: MPI.Comm) -> list[dict[str, Any]]:
    """Solve problem 1, whose exact solution is known, and the 2D problem 4 on the communicator's ranks. Collective there."""
    checks = []
    for name, changes in CHECKS.items():
        begin = perf_counter()
        check: dict[str, Any] = {"scene": name, "ranks": comm.size, "passed": False, "load": None}
        try:
            scene = load_scene(name, changes)
            solution = solve(scene, comm=PETSc.Comm(comm))
            check["load"] = solution.problem.quantities(solution.fields)["pressure_integral"]
            check["passed"], check["message"] = solution.converged, solution.message
            if exact := getattr(scene, "exact", lambda: None)():
                check["error"] = abs(check["load"] / exact.load - 1)
                if not check["error"] <= LOAD_TOL:
                    check |= {"passed": False, "message": f"load off by {check['error']:.1e}, at most {LOAD_TOL:g} is right"}
            solution.destroy()
        except Exception as error:  # whatever it is, it is what the doctor has to tell
            check |= {"passed": False, "message": f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"}
        check |= _first_failure(comm, check)
        checks.append({**check, "seconds": round(perf_counter() - begin, 3)})
    return checks


def _first_failure(comm: MPI.Comm, check: dict[str, Any]) -> dict[str, Any]:
    """The lowest rank's failure, on all ranks. Collective.

    Raises
    ------
    RuntimeError : this rank failed alone, and the others wait for it inside the solve: the job has to end.
    """
    if not all_come(comm, LIMIT if check["passed"] else ALONE):
        raise RuntimeError(f"self-check, {check['scene']}: {check['message']}")
    failed = [found for found in comm.allgather((check["passed"], check["message"])) if not found[0]]
    return {"passed": False, "message": failed[0][1]} if failed else {}


def two_ranks() -> list[dict[str, Any]]:
    """The self-check as a job of two ranks, which cannot hang this process or outlive it."""
    failed: dict[str, Any] = {"scene": "all", "ranks": 2, "passed": False, "load": None}
    mpiexec = shutil.which("mpiexec")
    if mpiexec is None:
        return [{**failed, "message": "there is no mpiexec on the path"}]
    # What this process's own MPI has left in the environment would make the job take itself for a part of it.
    own: tuple[str, ...] = ("OMPI_COMM", "PMIX_", "PMI_", "PRTE_", "ORTE_", "OPAL_", "HYDRA_", "HYDI_", "PETSC_OPTIONS")
    if "OMPI_UNIVERSE_SIZE" in os.environ:  # under mpiexec -n 1, whose settings cannot be told from the user's
        own = (*own, "OMPI_")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(own)} | MAY_START
    command = [mpiexec, "-n", "2", sys.executable, "-m", "lcp_lube.cli.doctor"]
    job = begin(command, environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        out, err = job.communicate(timeout=LIMIT)
    except subprocess.TimeoutExpired:
        job.terminate()  # mpiexec ends its ranks
        try:
            job.communicate(timeout=GRACE)
        except subprocess.TimeoutExpired:
            os.killpg(job.pid, signal.SIGKILL)
            job.communicate()
        return [{**failed, "message": f"mpiexec -n 2 had not ended after {LIMIT:.0f} s"}]
    line = next((line for line in out.splitlines() if line.startswith("[{")), None)
    if line is None:
        words = " ".join(word for word in err.split() if set(word) != {"-"})
        return [{**failed, "message": f"mpiexec -n 2 ended with status {job.returncode}: {words[:400]}"}]
    checks = json.loads(line)
    if any(check["ranks"] != 2 for check in checks):
        return [{**failed, "message": f"{mpiexec} starts two jobs of one rank: it belongs to another MPI than mpi4py's"}]
    return checks


def advice(report: dict[str, Any]) -> list[str]:
    """What to install or set, and what it is for."""
    has, versions = report["solver_packages"], report["versions"]
    say = []
    if "complex" in report["petsc_numbers"] or "float64" not in report["petsc_numbers"]:
        say.append("PETSc is not built with real double numbers: Debian's package is python3-petsc4py-real")
    if not has["hypre"]:
        say.append(
            "hypre: without it large 2D grids fall back on direct solvers; Debian's PETSc has it (python3-petsc4py-real), "
            "for PyPI's put --download-hypre into PETSC_CONFIGURE_OPTIONS"
        )
    if not (has["mumps"] or has["superlu_dist"]):
        say.append(
            "mumps: no direct solver for several ranks; Debian's PETSc has it (python3-petsc4py-real), for PyPI's put "
            "--download-mumps --download-scalapack into PETSC_CONFIGURE_OPTIONS"
        )
    if not (has["suitesparse"] or has["superlu"] or has["mumps"]):
        say.append("suitesparse, superlu: no good direct solver for one rank; as above, --download-suitesparse")
    if not has["hdf5"]:
        say.append("hdf5: no --output FILE.h5; .npz and .vts do not need it")
    if versions["numba"] is None:
        say.append("numba: sweeps along the film are compiled with it; pip install 'lcp-lube[fast]'")
    if versions["matplotlib"] is None:
        say.append("matplotlib: needed for --plot and the charts; pip install 'lcp-lube[plot]'")
    if report["mpiexec"] is None:
        say.append("mpiexec: needed for more than one rank; Debian's package is openmpi-bin")
    if report["blas"] and re.search(r"/blas/lib|/libblas", report["blas"]) and "openblas" not in report["blas"]:
        say.append(
            f"{report['blas']} is the slow reference BLAS: apt install libopenblas0-serial makes MUMPS four times faster"
        )
    if (report["omp_num_threads"] or "1") != "1":
        say.append(
            f"OMP_NUM_THREADS={report['omp_num_threads']}: 1 is right, the ranks are the parallelism (and SuperLU_DIST 8.1.2 "
            "gives wrong factors with more)"
        )
    if os.geteuid() == 0 and "Open MPI" in report["mpi"] and os.environ.get("OMPI_ALLOW_RUN_AS_ROOT") != "1":
        say.append("root: Open MPI starts jobs only with OMPI_ALLOW_RUN_AS_ROOT=1 and OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 set")
    return say


def text_of(report: dict[str, Any]) -> str:
    """The report for people; its last line is the verdict."""
    has = report["solver_packages"]
    rows = {
        "versions": ", ".join(f"{name} {version or 'missing'}" for name, version in report["versions"].items()),
        "PETSc has": ", ".join(name for name in has if has[name]) or "no solver package",
        "it lacks": ", ".join(name for name in has if not has[name]) or "nothing of what is looked for",
        "numbers": report["petsc_numbers"],
        "BLAS": report["blas"] or "unknown",
        "MPI": f"{report['mpi']}, {report['mpiexec'] or 'no mpiexec'}",
        "machine": f"{report['ranks']} ranks, {report['cores']} cores, {report['memory_gb']} GB, "
        f"OMP_NUM_THREADS {report['omp_num_threads'] or 'unset'}",
    }
    lines = table([(f"{title}:", row) for title, row in rows.items()], align="<<", least=[11], gap=" ")
    for check in report["self_check"]:
        verdict = "passed" if check["passed"] else "FAILED"
        error = f", load off by {check['error']:.1e} from the exact one" if check.get("error") is not None else ""
        why = "" if check["passed"] else f": {check['message']}"
        lines.append(f"self-check: {check['scene']} on {check['ranks']} rank{'s' * (check['ranks'] > 1)} {verdict}{error}{why}")
    lines += [f"to do:      {what}" for what in report["advice"]]
    seconds = sum(check.get("seconds", 0) for check in report["self_check"])
    lines.append(f"the self-check {'passed' if report['ok'] else 'FAILED'}, {seconds:.1f} s")
    return "\n".join(lines)


def _version(name: str) -> str | None:
    if importlib.util.find_spec(name) is None:
        return None
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:  # Debian's petsc4py on a path of its own
        return str(getattr(__import__(name), "__version__", "unknown"))


if __name__ == "__main__":
    found = self_check(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(found), flush=True)
