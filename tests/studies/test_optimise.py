"""Design: Rayleigh's step, limits, runs that go on, bad input."""

import csv

import pytest

from lcp_lube import InputError, load_scene
from lcp_lube.cli.arguments import GRAMMAR
from lcp_lube.studies.optimise import Limit, Range, optimise, parse_limit, parse_range

H, L, MU, U = 20e-6, 0.1, 0.02, 1.0
PAD = {
    "family": "bearing",
    "name": "pad",
    "L": L,
    "U": U,
    "n": 801,
    "fluid": {"mu": MU},
    "film": [{"shape": "constant", "h": H}, {"shape": "pocket", "depth": 10e-6, "x": [0.0, 0.05]}],
}
RANGES = [Range("film.pocket.depth", 1e-6, 60e-6), Range("film.pocket.x.2", 5e-3, 95e-3)]


def test_rayleighs_step():
    """The best of all films: ratio 1 + sqrt(3)/2, step at 0.7182 of the length, W = 0.2063 mu U L^2/h^2."""
    found = optimise(load_scene(PAD), "load", 1.0, RANGES)
    values = found.best.values
    assert found.converged
    assert 1.0 + values["film.pocket.depth"] / H == pytest.approx(1.8660, rel=1e-3)
    assert values["film.pocket.x.2"] / L == pytest.approx(0.718, rel=1.5e-3)
    assert found.best.results["load"] == pytest.approx(0.2063 * MU * U * L**2 / H**2, rel=1e-3)


def test_limits_are_kept():
    """A limit that binds: the best design lies on it, from a start outside of it too."""
    scene = load_scene({**PAD, "n": 51})
    for start in (10e-6, 40e-6):
        at = load_scene(scene.model_dump(exclude_unset=True), {"film.pocket.depth": start})
        limit = Limit("flow_east", 1.0, 1.05e-5)
        found = optimise(at, "load", 1.0, RANGES, [limit])
        assert found.best.results["flow_east"] == pytest.approx(limit.bound, rel=1e-4)
        assert limit.excess(found.best.results["flow_east"]) <= 1e-6
    with pytest.raises(InputError, match="no feasible start"):
        optimise(scene, "load", 1.0, RANGES, [Limit("friction", 1.0, 1.0)])


def test_a_run_goes_on(tmp_path):
    """Cut short, then whole: what stands in the csv is not solved again, and the answer is that of one run."""
    scene, path = load_scene({**PAD, "n": 60}), tmp_path / "designs.csv"
    depth = RANGES[:1]
    whole = optimise(scene, "load", 1.0, depth)
    optimise(scene, "load", 1.0, depth, history=path, most=2)
    before = path.read_text().splitlines()
    again = optimise(scene, "load", 1.0, depth, history=path)
    after = path.read_text().splitlines()
    assert after[: len(before)] == before and len(after) > len(before)
    assert again.best.results["load"] == pytest.approx(whole.best.results["load"], rel=1e-9)
    made = len(after)
    optimise(scene, "load", 1.0, depth, history=path)
    assert len(path.read_text().splitlines()) == made
    row = next(csv.DictReader(after))
    assert float(row["d load/d film.pocket.depth"]) != 0.0


def test_the_command(cli, tmp_path):
    """The example of its --help, on a coarser grid."""
    words = (*GRAMMAR["command"]["optimise"]["example"].split()[1:], "--n", "40")
    done = cli(*words, "--json")
    assert done.status == 0, done.err
    data = done.json
    assert data["best"]["results"]["load"] >= data["start"]["results"]["load"]
    again = cli("solve", "best.toml", "--json").json
    assert again["load"] == pytest.approx(data["best"]["results"]["load"], rel=1e-8)
    assert (tmp_path / "best.csv").is_file() and "load" in cli(*words).out


def test_ranges_and_limits():
    scene = load_scene("pocketed_pad")
    assert parse_range(scene, "depth_um=0.5:2") == parse_range(scene, "film.pocket.depth=0.5um:2um")
    assert parse_limit("friction <= 1kN/m") == Limit("friction", 1.0, 1000.0)
    for text, message in (("depth=1um", "FROM:TO"), ("n=1:2", "a count"), ("depth=2um:1um", "FROM < TO")):
        with pytest.raises(InputError, match=message):
            parse_range(scene, text)
    with pytest.raises(InputError, match="QUANTITY<=BOUND"):
        parse_limit("friction=1")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("problem1", "--vary", "h_min=1um:15um"), "--maximise Q or --minimise Q"),
        (("problem1", "--maximise", "load"), "--vary KEY=FROM:TO is needed"),
        (("problem1", "--maximise", "laod", "--vary", "h_min=10um:15um"), "nearest is load"),
        (("problem1", "--maximise", "load", "--vary", "h_min=30um:40um"), "no start"),
        (("bratu", "--maximise", "load", "--vary", "lambda=1:2"), "gradients are of films"),
        (("problem1", "--maximise", "load", "--vary", "h_min=9um:15um", "--output", "a.csv"), ".toml"),
    ],
)
def test_bad_input(cli, words, message):
    done = cli("optimise", *words)
    assert done.status == 2 and message in done.lines[0] and len(done.lines) == 1
