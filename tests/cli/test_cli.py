"""The command line's contract: what is printed where, and the exit status of every kind of input."""

import json
import math
import re

import pytest

from lcp_lube.__main__ import main
from lcp_lube.cli.arguments import parse
from lcp_lube.cli.words import check_options_file, split
from lcp_lube.errors import InputError
from lcp_lube.registry import METHODS, SYSTEMS, recipe_names, scene_names

LUBRICATION_KEYS = """scene nx ny unknowns ranks method system scheme recipe ksp_type pc_type outcome converged message
    iterations backtracking centrality linear_iterations c1 c2 p_max load friction cavitated_fraction min_p min_r
    complementarity residual mass_defect certificate_tol memory_mb time_s versions""".split()  # noqa: SIM905
NUMBERS = """p_max load friction cavitated_fraction min_p min_r complementarity residual mass_defect certificate_tol
    c1 c2 memory_mb""".split()  # noqa: SIM905


@pytest.fixture
def refused(capsys):
    """`refused("solve", ...)`: the one line on stderr of a command that ends with status 2, without a new process."""

    def run(*words):
        assert main([*words]) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and err.startswith("lcp-lube: "), err
        return err.removeprefix("lcp-lube: ").strip()

    return run


# --- bad input: one line that says what was found and what is allowed


@pytest.mark.parametrize(
    "words, message",
    [
        ("", "the following arguments are required: COMMAND"),
        ("solv problem1", "COMMAND solv: allowed are solve, "),
        ("solve", "the following arguments are required: SCENE"),
        ("solve problem1 extra", "unrecognized arguments: extra"),
        ("solve problem1 --methd din", "--methd: no such option; nearest is --method"),
        ("solve problem1 --vary U=1,2", "--vary: no such option; it is one of sweep, optimise"),
        ("solve pocketed_pad --set fluid=3", "fluid = 3: a table is needed"),
        ("solve problem1 --eps 1", "--eps: no such option; nearest is --eps"),
        ("solve problem1 --zzzzzzzz", "--zzzzzzzz: no such option"),
        ("solve problem1 --n many", "argument --n: invalid int value: 'many'"),
        ("solve problem1 --n 2.5", "argument --n: invalid int value: '2.5'"),
        ("solve problem1 --n", "argument --n: expected one argument"),
        ("sweep problem1 --vary U=1e308:-1e308:3", "--vary U=1e308:-1e308:3: FROM and TO must be finite"),
        ("solve journal --set D=1e300 --n 5", "film 2.5e+296 to 6.25e+296 m"),
        ("solve rough --set cells=2000000000 --n 5", "rough: cells = 2000000000: allowed is less than or equal to 4000"),
        ("solve problem1 --p0 1um", "--p0 1um: a pressure (Pa, kPa, MPa, GPa, bar) is needed, not a length"),
        ("solve problem1 --p0 small", "--p0 small: a number, or a pressure with its unit, is needed"),
        ("solve bratu --p0 1bar", "--p0 1bar: scene bratu has no pressures; a number without a unit is needed"),
        ("solve problem1 --eps1 1um", "argument --eps1: 1um: a number without a unit is needed, not a length"),
        ("sweep problem1 --vary h_min=10um:1MPa:2", "--vary h_min=10um:1MPa:2: values of one dimension are needed"),
        (
            "sweep problem1 --vary h_min=1MPa:2MPa:2",
            "problem1: h_min = 1000000.0 m^-1 kg^1 s^-2: a length (m, mm, um, nm) is needed",
        ),
        ("solve problem1 --eps1 small", "argument --eps1: invalid float value: 'small'"),
        ("solve problem7", "scene problem7: neither a .toml file nor a built-in name; nearest is problem"),
        ("solve nowhere.toml", "nowhere.toml: No such file or directory"),
        ("solve problem1 --n 0", "problem1: n = 0: allowed is greater than or equal to 1"),
        ("solve problem1 --n 1000000000000", "problem1: n = 1000000000000: allowed is less than"),
        ("solve problem1 --n 1000000000", "grid 1000000000: 1000000000 points need"),
        ("solve problem4 --n 2000000000", "grid 2000000000x2000000000: 4000000000000000000 points"),
        ("solve problem1 --ny 4", "problem1: ny = 4: the scene is one-dimensional"),
        ("solve problem1 --set h_min=-1e-6", "problem1: h_min = -1e-06: allowed is greater than 0"),
        ("solve problem1 --set mu=0", "problem1: mu = 0: allowed is greater than 0"),
        ("solve problem1 --set mu=nan", "problem1: mu = nan: allowed is a finite number"),
        ("solve problem1 --set U=inf", "problem1: U = inf: allowed is a finite number"),
        ("solve problem1 --set U=1e200", "film 1.5"),
        ("solve problem1 --set h_min", "--set h_min: KEY=VALUE is needed"),
        ("solve problem1 --set hmin=1e-5", "problem1: unknown key hmin; nearest is h_min"),
        ("solve problem1 --set p_c=none", "problem1: p_c = none: allowed is a valid number"),
        (
            "solve problem1 --set dinn.gamma=0.5",
            "--set dinn.gamma: dinn is no table of the scene, and no method; nearest is din",
        ),
        ("solve problem1 --method din --set din.gama=0.5", "din.gama: method din has no such option; nearest is gamma"),
        ("solve problem1 --method din --set din.gamma=2", "din.gamma = 2.0: allowed are numbers between 0 and 1"),
        ("solve problem1 --film saw", "problem1: film = saw: allowed is 'sinusoid' or 'parabola'"),
        ("solve problem1 --method dim", "--method dim: allowed are auto, "),
        ("solve problem1 --method newton", "--method newton: not for scene problem1; allowed are "),
        ("solve problem1 --system ful", "--system ful: allowed are auto, "),
        ("solve problem1 --recipe gmres-ilu", "--recipe gmres-ilu: no such recipe; nearest is gmres_ilu"),
        ("solve problem1 --eps1 0", "--eps1 0.0: allowed are numbers between 0 and 1"),
        ("solve problem1 --eps1 nan", "--eps1 nan: allowed are numbers between 0 and 1"),
        ("solve problem1 --eps2 -1", "--eps2 -1.0: allowed are numbers between 0 and 1"),
        ("solve problem1 --max-it 0", "--max-it 0: at least 1 is needed"),
        ("solve problem1 --method din --p0 -1", "--p0 -1.0: a positive number is needed"),
        ("solve problem1 --method din --r0 nan", "--r0 nan: a positive number is needed"),
        ("solve problem1 --method din --mu mu3", "--mu mu3: allowed are mu1, mu2, adaptive"),
        ("solve problem1 --conditions XYZ", "--conditions XYZ: any combination of the letters F, R, C, B"),
        ("solve problem1 --output /nonexistent/x.npz", "--output /nonexistent/x.npz: "),
        ("solve problem1 --output x.xyz", "--output x.xyz: "),
        ("solve problem1 --plot /nonexistent/x.png", "--plot /nonexistent/x.png: "),
        ("compare problem1 --methods din,dim", "--methods dim: allowed are auto, "),
        ("table", "the following arguments are required: K"),
        ("table two", "argument K: invalid int value: 'two'"),
        ("solve problem1 -options_file nowhere.opts", "-options_file nowhere.opts: No such file or directory"),
        ("solve problem1 -options_file", "-options_file: a file name is needed"),
    ],
)
def test_bad_input(refused, words, message):
    assert message in refused(*words.split())


@pytest.mark.parametrize("scene", ["folder.toml", "bytes.toml", "empty.toml", "broken.toml", "typo.toml"])
def test_bad_scene_files(refused, tmp_path, monkeypatch, scene):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "broken.toml").write_text("h_min = = 1\n")
    (tmp_path / "typo.toml").write_text("family = 'slider'\nh_mim = 1e-5\n")
    assert refused("solve", scene).startswith(f"{scene}: ")


# --- success and failure


def check_json(run, status=0):
    """stdout is one JSON object with every key, its numbers finite."""
    assert run.status == status, run.err
    data = run.json
    assert list(data)[: len(LUBRICATION_KEYS)] != [] and not set(LUBRICATION_KEYS) - set(data)
    assert all(isinstance(data[key], float) and math.isfinite(data[key]) for key in NUMBERS)
    assert all(value is None or math.isfinite(value) for value in data["time_s"].values())
    return data


def test_json(cli):
    run = cli("solve", "problem1", "--method", "din", "--n", 30, "--json")
    data = check_json(run)
    assert run.err == "" and run.out.count("\n") == 1
    assert (data["converged"], data["outcome"], data["scene"], data["nx"], data["ny"]) == (
        True,
        "converged",
        "problem1",
        30,
        None,
    )
    assert (data["unknowns"], data["ranks"], data["method"], data["scheme"]) == (60, 1, "din", "nodal")
    assert 0.06 < data["rupture"] < 0.07 and data["reformation"] is None
    assert {"total", "assembly", "linear", "setup"} <= set(data["time_s"])
    assert {"petsc", "petsc4py", "numpy", "lcp_lube"} <= set(data["versions"])


def test_json_keeps_stdout_whatever_petsc_prints(cli):
    """Monitors, views and -log_view, which comes after our last word, go to stderr; -log_view names our stages."""
    words = "-ksp_monitor -ksp_view -ksp_converged_reason -options_left -log_view".split()  # noqa: SIM905
    run = cli("solve", "problem1", "--method", "din", "--recipe", "gmres_ilu", "--n", 20, "--monitor", "--json", *words)
    check_json(run)
    for text in ("KSP Residual norm", "KSP Object", "Linear solve converged", "There are no unused options", "   1  ||F||"):
        assert text in run.err
    for stage in ("setup", "assembly", "Jacobian", "KSP", "step length"):
        assert re.search(rf"^ *\d+: +{stage}: ", run.err, flags=re.MULTILINE), stage


def test_summary(cli):
    run = cli("solve", "problem2", "--n", 40, "--explain")
    assert run.status == 0
    for text in ("problem2 (n = 40", "converged: ", "p_max 6.6", "load 15", "certificate (tol 1e-04): residual "):
        assert text in run.out
    assert "rupture 66." in run.out and "reformation 95." in run.out
    assert "method " in run.err


def test_not_converged_is_status_1(cli):
    run = cli("solve", "problem1", "--method", "din", "--n", 30, "--max-it", 3, "--json")
    data = check_json(run, status=1)
    assert (data["outcome"], data["converged"], data["iterations"]) == ("max_iterations", False, 3)
    assert data["message"].startswith("not converged after 3 iterations")


def test_wrong_solution_is_status_1(cli):
    data = check_json(cli("solve", "problem1", "--method", "din", "--conditions", "B", "--json"), status=1)
    assert (data["outcome"], data["converged"]) == ("wrong_solution", False) and data["min_p"] < 0


def test_not_finite_is_null_in_json(cli):
    run = cli("solve", "problem1", "--method", "din", "--n", 5, "--p0", 1e300, "--json")
    assert run.status == 1 and all("warning: p_max" in line for line in run.lines)
    data = run.json
    assert (data["outcome"], data["converged"], data["c1"], data["iterations"]) == ("not_finite", False, None, 0)


def test_compare(cli):
    run = cli("compare", "problem1", "--n", 20, "--methods", "din,active-set", "--json")
    assert run.status == 0 and run.err == ""
    assert [row["method"] for row in run.json] == ["din", "active-set"]
    assert all(row["converged"] for row in run.json)


def test_list_names_everything(capsys):
    assert main(["list"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for name in (*scene_names(), *METHODS, *SYSTEMS, *recipe_names()):
        assert re.search(rf"^  {re.escape(name)} +\S", out, flags=re.MULTILINE), name


def test_a_pipe_that_closes_is_no_error(cli, tmp_path):
    """`lcp-lube ... | head`: no report of a crash."""
    import subprocess
    import sys

    from conftest import ENVIRONMENT

    command = f"{sys.executable} -m lcp_lube solve problem1 --n 9 -ksp_view -mat_view | head -n 1"
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stderr == "" and done.stdout.count("\n") == 1


# --- PETSc's options


def test_misspelt_option_in_an_options_file(cli, tmp_path):
    (tmp_path / "my.opts").write_text("# mine\n-ksp_type gmres\n-pc_typ ilu # typo\n")
    run = cli("solve", "problem1", "--n", 9, "-options_file", "my.opts")
    assert (run.status, run.out) == (2, "")
    assert run.lines == ["lcp-lube: -pc_typ: no solver in this run reads this option; nearest is -pc_type"]


@pytest.mark.parametrize(
    "options, message",
    [
        ("-ksp_typ gmres", "-ksp_typ: no solver in this run reads this option; nearest is -ksp_type"),
        ("-ksp_type gmress", "-ksp_type gmress: no such KSP type in this PETSc; nearest is gmres"),
    ],
)
def test_misspelt_options(cli, options, message):
    run = cli("solve", "problem1", "--n", 9, *options.split())
    assert (run.status, run.out, run.lines) == (2, "", [f"lcp-lube: {message}"])


def test_options_file_and_command_line_work_together(cli, tmp_path):
    (tmp_path / "my.opts").write_text("-ksp_type gmres\n-pc_type ilu\n")
    words = ["solve", "problem1", "--n", 9, "--method", "din", "--json"]
    settings = [cli(*words, "-options_file", "my.opts", *more).json for more in ([], ["-ksp_type", "bcgs"])]
    assert [(data["ksp_type"], data["pc_type"], data["recipe"]) for data in settings] == [
        ("gmres", "ilu", None),
        ("bcgs", "ilu", None),
    ]


@pytest.mark.parametrize(
    "content, message",
    [
        (b"ksp_type gmres\n", "line 1: ksp_type: an option that begins with a dash is needed"),
        (b"# fine\n-ksp_type gmres\n3 4\n", "line 3: 3: an option that begins with a dash is needed"),
        (b"\xff\x00\x01", "not a text file"),
    ],
)
def test_options_files_that_petsc_would_abort_on(tmp_path, content, message):
    file = tmp_path / "my.opts"
    file.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(message)):
        check_options_file(str(file))
    with pytest.raises(InputError, match="Is a directory"):
        check_options_file(str(tmp_path))


def test_every_recipe_is_an_options_file():
    from lcp_lube.registry import RECIPE_DIR

    for name in recipe_names():
        check_options_file(str(RECIPE_DIR / f"{name}.opts"))


# --- the grammar


@pytest.mark.parametrize(
    "words, own, petsc",
    [
        ("solve problem1 -ksp_type gmres --json", "solve problem1 --json", "-ksp_type gmres"),
        ("solve problem1 -ksp_monitor --json", "solve problem1 --json", "-ksp_monitor"),
        ("solve problem1 -ksp_gmres_restart -1 -x -.5", "solve problem1", "-ksp_gmres_restart -1 -x -.5"),
        ("solve problem1 --p0 -1 --set p_c=-1", "solve problem1 --p0 -1 --set p_c=-1", ""),
        ("solve -log_view problem1", "solve problem1", "-log_view"),
        ("solve --n 5 -log_view problem4 -ksp_type gmres", "solve problem4 --n 5", "-log_view -ksp_type gmres"),
        ("solve -ksp_view my.toml", "solve my.toml", "-ksp_view"),
        ("-log_view solve problem1", "problem1", "-log_view solve"),
        ("solve problem1 -log_view :out.txt", "solve problem1", "-log_view :out.txt"),
        ("solve -h", "solve -h", ""),
    ],
)
def test_split(words, own, petsc):
    assert split(words.split()) == (own.split(), petsc.split())


def test_a_scene_after_a_petsc_flag(cli):
    run = cli("solve", "-ksp_converged_reason", "problem1", "--n", 9)
    assert run.status == 0 and "problem1 (n = 9" in run.out


def test_help(capsys):
    for words, texts in (
        (["--help"], ["COMMAND", "Every single-dash option goes to PETSc", "-help"]),
        (["solve", "--help"], ["SCENE", "--conditions", "--recipe"]),
    ):
        with pytest.raises(SystemExit) as ended:
            parse(words)
        out = " ".join(capsys.readouterr().out.split())
        assert ended.value.code == 0 and all(text in out for text in texts)
    assert "start of p in the scene's p_unit (MPa in the published problems)" in out


def test_petscs_help(cli):
    run = cli("-help")
    assert run.status == 0 and "Options for all PETSc programs" in run.out


def test_version(cli):
    run = cli("--version")
    assert run.status == 0 and re.fullmatch(r"lcp-lube \d+\.\d+\.\d+\n", run.out)


def test_json_is_what_the_library_says(cli):
    """The same run from Python: the same numbers."""
    from lcp_lube import load_scene, solve
    from lcp_lube.output.results import as_dict, finite

    data = cli("solve", "problem3", "--n", 25, "--method", "din", "--recipe", "superlu", "--json").json
    solution = solve(load_scene("problem3", {"n": 25}), method="din", recipe="superlu")
    ours = json.loads(json.dumps(finite(as_dict(solution))))
    for key in (key for key in data if key != "time_s" and not key.startswith("memory_")):
        assert data[key] == ours[key], key
    solution.destroy()
