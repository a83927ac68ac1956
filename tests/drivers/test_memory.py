"""Estimates of memory: near the peak, refused when there is too little, and nothing that grows."""

from types import SimpleNamespace

import pytest

from lcp_lube.api import solve
from lcp_lube.base.options import recipe
from lcp_lube.drivers import memory
from lcp_lube.errors import InputError
from lcp_lube.scenes.scene import load_scene

GB = 2**30


@pytest.mark.parametrize(
    "words, sizes",
    [
        ("problem4 --method din --max-it 1 --no-rescue", (50, 100, 160)),  # a direct solver
        pytest.param(
            "problem4 --method active-set --max-it 2 --no-rescue --system cavity --recipe bcgs_amg --set active-set.sweeps=9",
            (100, 200, 300),
            marks=pytest.mark.hypre,
        ),
        ("problem4 --method din --recipe gmres_ilu --max-it 1 --no-rescue", (120,)),
        ("problem4 --method fas", (500,)),
        ("problem1 --method din --max-it 2 --no-rescue", (60_000,)),
        ("problem1 --method din --max-it 2 --no-rescue --recipe lu", (1000,)),
    ],
)
def test_peaks_are_foreseen(cli, words, sizes):
    """Within 25 %, each in a process of its own."""
    for n in sizes:
        data = cli("solve", *words.split(), "--n", n, "--json", new=True).json
        assert data["memory_estimate_mb"] == pytest.approx(data["memory_mb"], rel=0.25), n
        assert 0 < data["memory_base_mb"] < data["memory_estimate_mb"]


def test_on_several_ranks(cli):
    data = cli(
        "solve", "problem4", "--n", 50, "--method", "din", "--max-it", 1, "--no-rescue", "--json", ranks=2, new=True
    ).json
    assert data["memory_estimate_mb"] == pytest.approx(data["memory_mb"], rel=0.25)


def test_said_by_explain(cli):
    run = cli("solve", "problem1", "--explain")
    assert run.status == 0 and any(line.startswith("memory: about") for line in run.lines)


def test_too_large_is_refused_before_it_starts(cli):
    """One line, status 2, in which the method, the need and what there is stand; nothing is built for that."""
    run = cli("solve", "problem4", "--n", 25_000, "--method", "din")
    assert run.status == 2 and len(run.lines) == 1 and not run.out
    assert "grid 25000x25000: 625000000 points" in run.lines[0] and "method din on the full system" in run.lines[0]


@pytest.mark.parametrize("name", ["problem1", "problem4", "journal", "ehl_line", "obstacle_bratu", "bratu", "pocketed_pad_2d"])
def test_what_a_scene_says_of_itself_is_true_of_its_problem(name):
    """It is planned, and its memory estimated, before it is built."""
    scene = load_scene(name, {"n": 30})
    facts, problem = scene.facts(), scene.build()
    grid = problem.grid
    assert (facts.kind, facts.shape, facts.size, facts.dim) == (problem.kind, grid.shape, grid.size, grid.dim)
    assert facts.dense == getattr(problem, "dense", False) and facts.whole_lines == (grid.dim == 2)
    assert any(facts.periodic) == any(grid.periodic)
    problem.destroy()


def test_a_large_scene_is_refused_before_it_is_built(monkeypatch):
    scene = load_scene("problem4", {"n": 3000})
    monkeypatch.setattr(memory, "available", lambda: 1000)
    monkeypatch.setattr(type(scene), "build", None)
    with pytest.raises(InputError, match="9000000 points need about"):
        solve(scene)


def test_the_override(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 1000)
    monkeypatch.setattr(memory, "LITTLE", 0)
    with pytest.raises(InputError, match=r"100 points need about .* GB .*--no-memory-check"):
        solve(load_scene("problem1"))
    solution = solve(load_scene("problem1"), memory_check=False)
    assert solution.converged
    solution.destroy()


def test_every_run_of_a_film_has_an_estimate(petsc_options):
    """Whatever the inner solver: one that was not measured counts as the most expensive of its system."""
    facts = load_scene("problem4", {"n": 40}).facts()
    for system in ("full", "reduced", "cavity"):
        chosen = SimpleNamespace(system=system, recipe=None, nested=False, method="din")
        with recipe("umfpack"):
            direct = memory.bytes_needed(facts, chosen)
        petsc_options(ksp_type="bcgs", pc_type="jacobi")
        assert 0 < memory.bytes_needed(facts, chosen) <= max(direct, 1000 * 1600)
        petsc_options(ksp_type="preonly", pc_type="lu", pc_factor_mat_solver_type="cholmod")
        assert memory.bytes_needed(facts, chosen) >= direct
        for name in ("ksp_type", "pc_type", "pc_factor_mat_solver_type"):
            from petsc4py import PETSc

            PETSc.Options().delValue(name)


def test_limits_of_control_groups(tmp_path):
    """The tightest of those above the process, in version 2 and 1; files that could be dropped do not count as used."""
    own = tmp_path / "cgroup"
    v2, v1 = tmp_path / "sys" / "job" / "step", tmp_path / "sys" / "memory" / "job"
    for folder, values in (
        (v2, {"memory.max": "max", "memory.current": 5, "memory.stat": "inactive_file 1\n"}),
        (v2.parent, {"memory.max": 4 * GB, "memory.current": 3 * GB, "memory.stat": f"anon 1\ninactive_file {GB}\n"}),
        (v1, {"memory.limit_in_bytes": 9 * GB, "memory.usage_in_bytes": GB, "memory.stat": "total_inactive_file 0\n"}),
    ):
        folder.mkdir(parents=True, exist_ok=True)
        for name, value in values.items():
            (folder / name).write_text(f"{value}\n")
    own.write_text("0::/job/step\n")
    assert memory._groups(own, tmp_path / "sys") == [2 * GB]
    own.write_text("9:memory:/job\n8:cpu:/job\n")
    assert memory._groups(own, tmp_path / "sys") == [8 * GB]
    assert memory._groups(tmp_path / "nothing", tmp_path) == []
    assert 0 < memory.available() < 2**50 and memory.resident() > 10**6
