"""Starting PETSc, and what is left of a run when something outside fails: one line each, and the result is printed first."""

import os
import subprocess
import sys

import pytest
from conftest import ENVIRONMENT

from lcp_lube.__main__ import main
from lcp_lube.base import petsc as petsc_start
from lcp_lube.errors import InputError


@pytest.mark.parametrize(
    "words, message",
    [
        ("-log_view foo", "-log_view foo: nothing, or :FILE[:FORMAT], is allowed"),
        ("-log_view :/no/such/x", "-log_view :/no/such/x: folder /no/such does not exist"),
        ("-log_view :x:ascii_xmll", "format ascii_xmll: allowed are default, "),
        ("-ksp_view :/no/such/x", "-ksp_view :/no/such/x: folder /no/such does not exist"),
        ("-ksp_monitor ascii:/no/such/x", "folder /no/such does not exist"),
        ("-ksp_view :/", "-ksp_view :/: cannot be written"),
        ("-history /no/such/x", "-history /no/such/x: folder /no/such does not exist"),
        ("-options_left maybe", "-options_left maybe: allowed are true and false"),
    ],
)
def test_what_petsc_would_crash_on(words, message):
    with pytest.raises(InputError) as refused:
        petsc_start.check(words.split())
    assert message in str(refused.value)


@pytest.mark.parametrize(
    "words", ["", "-log_view", "-log_view :x:ascii_xml", "-ksp_monitor", "-ksp_rtol -1", "-options_left", "-x -.5 -log_view"]
)
def test_what_is_fine(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    petsc_start.check(words.split())


def test_petsc_does_not_start(cli):
    """An option that it reads before anything can be caught: its words in one line."""
    run = cli("solve", "problem1", "--n", 9, "-fp_trap", "maybe")
    assert (run.status, run.out) == (2, "")
    assert run.lines == ["lcp-lube: -fp_trap maybe: PETSc does not start: Unknown logical value: maybe"]


@pytest.mark.parametrize(
    "options, message",
    [
        ("-ksp_gmres_restart 0", "-ksp_gmres_restart 0: PETSc: Restart must be positive"),
        ("-pc_factor_levels -3", "-pc_factor_levels -3: PETSc: Levels of fill negative -3"),
    ],
)
def test_an_error_that_names_no_option_is_told_with_it(cli, options, message):
    run = cli("solve", "problem1", "--n", 9, "--method", "din", "--recipe", "gmres_ilu", *options.split())
    assert (run.status, run.lines) == (2, [f"lcp-lube: {message}"])


def test_one_thread_unless_more_are_asked_for(tmp_path):
    """Set before PETSc is loaded, whose OpenMP reads it then."""
    code = "import os, sys; from lcp_lube.base.petsc import start; start([]); print(os.environ['OMP_NUM_THREADS'])"
    for given, expected in ((None, "1"), ("2", "2")):
        environment = {key: value for key, value in ENVIRONMENT.items() if key != "OMP_NUM_THREADS"}
        environment |= {"OMP_NUM_THREADS": given} if given else {}
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=True
        )
        assert done.stdout.split() == [expected]


def test_superlu_dist_has_one_thread_whatever_the_environment_says():
    """It gives wrong factors with more: with them the counts of this run change from run to run."""
    code = (
        "import ctypes; from petsc4py import PETSc; from lcp_lube import load_scene, solve\n"
        "library = ctypes.CDLL(PETSc.__file__)\n"
        "threads = getattr(library, 'omp_get_max_threads', lambda: 1)\n"
        "print(threads())\n"
        "s = solve(load_scene('problem1', {'n': 30}), method='din', system='full', recipe='superlu_dist')\n"
        "print(threads(), s.outcome)\n"
    )
    environment = ENVIRONMENT | {"OMP_NUM_THREADS": "3"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    if "Could not locate" in done.stderr or "no such" in done.stderr:
        pytest.skip("this PETSc has no superlu_dist")
    before, after = done.stdout.splitlines()
    assert before in ("1", "3") and after == "1 converged", done.stderr


ALL = "import sys; from lcp_lube.__main__ import main; status = main(sys.argv[1:]); print(*sys.modules); sys.exit(status)"
LATE = {"scipy", "numba", "matplotlib", "tqdm", "difflib", "h5py", "xarray"}  # what small solves do without


@pytest.mark.parametrize("words", [("problem1",), ("problem4", "--n", "60"), ("problem4", "--n", "60", "--no-reduction")])
def test_a_small_solve_imports_little(words):
    """Counted, not timed: what is slow to import comes where it is used, and families of scenes one by one."""
    done = subprocess.run(
        [sys.executable, "-c", ALL, "solve", *words], env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=True
    )
    loaded = done.stdout.splitlines()[-1].split()
    assert not LATE & {name.partition(".")[0] for name in loaded}
    own = [name for name in loaded if name.startswith("lcp_lube")]
    assert not [name for name in own if name.startswith(("lcp_lube.studies", "lcp_lube.solvers.fas", "lcp_lube.linear.pc"))]
    assert not {"bearing", "textured", "squeeze", "obstacle", "semilinear", "user"} & {
        name.rpartition(".")[2] for name in own if name.startswith("lcp_lube.scenes.")
    }
    assert len(own) <= 150  # drivers of scenes that nobody loaded stay where they are; any film may name effects, one file each


SMALL = ["pocketed_pad_2d", "two_groove_journal", "dam_journal", "ring_journal", "circumferential_groove_journal"]


@pytest.mark.parametrize("scene", SMALL)
def test_small_bearings_wait_for_no_compiler(scene):
    """Half a second of a second: direct steps that come down by themselves are let do so."""
    done = subprocess.run(
        [sys.executable, "-c", ALL, "solve", scene], env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=True
    )
    assert "numba" not in done.stdout.splitlines()[-1].split()


def test_the_package_alone_imports_nothing():
    code = "import sys; before = set(sys.modules); import lcp_lube; print(*set(sys.modules) - before)"
    done = subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=True)
    loaded = done.stdout.split()
    assert "lcp_lube" in loaded and not {"numpy", "petsc4py", "mpi4py", "pydantic"} & set(loaded) and len(loaded) < 20


def test_a_process_alone_starts_no_daemon():
    """Open MPI would start one for processes that never come; what it is told so stays with this process."""
    code = (
        "import os; from pathlib import Path; from lcp_lube.base import petsc\n"
        "petsc.start([])\n"
        "children = Path(f'/proc/self/task/{os.getpid()}/children')\n"
        "print(children.read_text().split() if children.exists() else [])\n"
        "print([name for name in petsc.ALONE if name in os.environ])"
    )
    done = subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "[]\n[]\n"


def test_a_failed_write_costs_no_result(capsys, tmp_path, monkeypatch):
    """The disk fills up during the run: the summary, the other files, then one line and status 2."""
    from lcp_lube.output import files

    monkeypatch.chdir(tmp_path)
    honest = files.save

    def save(solution, path, boundary):
        if path == "full.npz":
            raise InputError(f"{path}: could not be written: No space left on device")
        honest(solution, path, boundary)

    monkeypatch.setattr(files, "save", save)
    assert main(["solve", "problem1", "--n", "20", "--output", "full.npz", "--output", "good.npz"]) == 2
    out, err = capsys.readouterr()
    assert "converged" in out and "p_max" in out and (tmp_path / "good.npz").stat().st_size > 0
    assert err == "lcp-lube: full.npz: could not be written: No space left on device\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_standard_output_that_is_full(tmp_path):
    command = f"{sys.executable} -m lcp_lube solve problem1 --n 9 --json > /dev/full"
    done = subprocess.run(
        ["sh", "-c", command], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2 and done.stderr == "lcp-lube: standard output: No space left on device\n"
