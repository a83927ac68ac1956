"""Every command, program and scene of the user guide runs as it stands there; the Slurm script is a good shell script."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import python
from test_readme import run, with_command

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
PAGES = {page.stem: page.read_text(encoding="utf-8") for page in sorted(GUIDE.glob("*.md"))}


def blocks(kind):
    """Pages with their blocks of a kind, `scenes.md`, which is generated, left out."""
    found = []
    for page, text in PAGES.items():
        if page != "scenes":
            found += [(page, block) for block in re.findall(rf"^```{kind}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)]
    return found


SHELL = blocks("sh")
DONE: set[str] = set()
PROGRAMS = blocks("python")
SCENES = blocks("toml")


def test_the_pages_are_there():
    assert {
        "README",
        "first_steps",
        "scenes",
        "methods",
        "recipes",
        "parallel",
        "troubleshooting",
        "python",
        "versions",
    } <= set(PAGES)
    assert len([page for page, _ in PROGRAMS if page == "python"]) >= 6 and SHELL and SCENES


def test_the_scene_reference_is_current():
    """After a change of a scene's keys: python tools/scene_reference.py."""
    path = GUIDE.parent.parent / "tools" / "scene_reference.py"
    specification = importlib.util.spec_from_file_location("scene_reference", path)
    assert specification and specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    assert module.page() == PAGES["scenes"]


@pytest.fixture
def environment(tmp_path):
    return with_command(tmp_path, python())


@pytest.mark.parametrize("page", [*PAGES])
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)", PAGES[page]):
        assert target.startswith("http") or (GUIDE / target).exists(), target


@pytest.mark.parametrize("page, block", SHELL)
def test_commands(page, block, tmp_path, environment):
    """The lines of a block one after the other, in one folder; what several pages say and leaves no file runs once."""
    for line in block.splitlines():
        assert re.match(r"(mpiexec -n \d |)lcp-lube ", line), line
        command = line.partition("  #")[0].strip()
        if command in DONE and not re.search(r"--(plot|output|checkpoint|history|errors)| new ", command):
            continue
        DONE.add(command)
        done = run(["sh", "-c", line], tmp_path, environment)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        for name in re.findall(r"(?:--plot|--output|--checkpoint) (\S+)", line):
            assert (tmp_path / name).stat().st_size > 0


@pytest.mark.parametrize("page, block", PROGRAMS)
def test_programs(page, block, tmp_path, environment):
    done = run([sys.executable, "-W", "error", "-c", block], tmp_path, environment)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page, block", SCENES)
def test_scenes(page, block, tmp_path, environment):
    (tmp_path / "my.toml").write_text(block)
    done = run(["lcp-lube", "solve", "my.toml"], tmp_path, environment)
    assert done.returncode == 0, done.stderr


def test_the_options_file_of_the_recipes_page(tmp_path, environment):
    ((_, options),) = blocks("text")
    (tmp_path / "my.opts").write_text(options)
    done = run(["lcp-lube", "solve", "problem4", "--n", "20", "-options_file", "my.opts"], tmp_path, environment)
    assert done.returncode == 0, done.stderr


def test_the_slurm_script_resumes_and_requeues(tmp_path, environment):
    """With an srun of its own: the first job is told to end, the second one goes on from the checkpoint."""
    ((_, script),) = blocks("bash")
    home, calls = tmp_path / "home", tmp_path / "calls"
    (home / "lcp_lube" / ".venv" / "bin").mkdir(parents=True)
    (home / "lcp_lube" / ".venv" / "bin" / "activate").write_text("")
    (tmp_path / "my_bearing.toml").write_text("family = 'slider'\nn = 30\n")
    (tmp_path / "job.sh").write_text(script)
    tools = tmp_path / "tools"
    tools.mkdir()
    for name, body in {
        "srun": f'echo "$@" >> {calls}; [ -e stopped ] || {{ touch stopped my_bearing.ckpt; exit 143; }}',
        "scontrol": f'echo "scontrol $@" >> {calls}',
    }.items():
        (tools / name).write_text(f"#!/bin/sh\n{body}\n")
        (tools / name).chmod(0o755)
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash")
    variables = {"HOME": str(home), "PATH": f"{tools}:/usr/bin:/bin", "SLURM_SUBMIT_DIR": str(tmp_path), "SLURM_JOB_ID": "7"}
    jobs = [subprocess.run([bash, "job.sh"], cwd=tmp_path, env=variables, capture_output=True, text=True) for _ in range(2)]
    assert [job.returncode for job in jobs] == [143, 0], jobs
    words = calls.read_text().splitlines()
    assert (
        words[1] == "scontrol requeue 7" and "--resume" not in words[0] and f"--resume {tmp_path}/my_bearing.ckpt" in words[2]
    )
