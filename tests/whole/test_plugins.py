"""One file and one line for a thing of each kind: toys from outside are found wherever names are listed and used."""

import os
from pathlib import Path

import pytest

TOYS = Path(__file__).parents[1] / "toys"


@pytest.fixture
def toys(cli, monkeypatch):
    monkeypatch.setattr("conftest.ENVIRONMENT", {**__import__("conftest").ENVIRONMENT, "PYTHONPATH": path()})
    return cli


def path() -> str:
    return os.pathsep.join([str(TOYS), str(TOYS.parents[1]), os.environ.get("PYTHONPATH", "")])


def test_toys_are_listed(toys):
    out = toys("list").out
    for name in ("toy-method", "toy-shape", "toy-map", "toy_liner"):
        assert f"  {name}" in out, name
    assert "toy-map, a toy" in toys("chart", "stability", "--help").out


def test_toys_solve(toys, tmp_path):
    """A family, a method and a driver; then a film shape."""
    (tmp_path / "a.toml").write_text('family = "toy-family"\nn = 30\n')
    done = toys("solve", "a.toml", "--method", "toy-method", "--json", "--explain")
    assert done.status == 0 and done.json["method"] == "toy-method" and "the toy driver was here" in done.err
    (tmp_path / "b.toml").write_text(
        'family = "bearing"\nL_mm = 10\nU = 1\nn = 20\nfluid.mu = 0.01\nfilm = [{ shape = "toy-shape", h_um = 2 }]\n'
    )
    assert toys("solve", "b.toml", "--json").json["min_h"] == pytest.approx(2e-6)
    assert toys("new", "c.toml", "--from", "a.toml").status == 0


def test_a_toy_effect(toys, tmp_path):
    """An effect from outside is solved for, certified, named and left out as the package's own; it is what [elastic] does."""
    scene = 'family = "bearing"\nL_mm = 10\nU = 1\nn = 300\nfluid.mu = 0.01\n'
    film = 'film = [{ shape = "linear", h_start_um = 4, h_end_um = 2 }]\n'
    loads = {}
    for name, table in (("toy", "toy_liner.D = 1e-14"), ("elastic", "elastic.compliance = 1e-14")):
        (tmp_path / f"{name}.toml").write_text(scene + table + "\n" + film)
        done = toys("solve", f"{name}.toml", "--json")
        loads[name] = done.json["load"]
        assert done.status == 0 and done.json["coupling"] < 1e-8
    assert loads["toy"] == pytest.approx(loads["elastic"], rel=1e-9)
    assert "toy_liner" in toys("solve", "toy.toml", "--model", "least", "--json").json["model"]["left_out"]


def test_toys_are_compared_and_charted(toys):
    rows = toys("compare", "problem1", "--n", 30, "--methods", "toy-method,active-set", "--json").json
    assert [row["outcome"] for row in rows] == ["converged"] * 2 and rows[0]["p_max"] == pytest.approx(rows[1]["p_max"])
    assert "the toy's map" in toys("chart", "stability", "toy-map", "--quick").out
