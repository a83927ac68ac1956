"""Load, force and moment of flat films and of films round a shaft; what corners leak; all fronts of a film."""

import csv

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.output.results import as_dict, summary
from lcp_lube.problems.film.quantities import shaft_force

D, B, C, E, MU, OMEGA = 0.1, 0.1, 5e-5, 0.5, 0.02, 100.0


def found(scene, **how):
    solution = solve(scene, **how)
    assert solution.converged, solution.message
    data = as_dict(solution)
    solution.destroy()
    return data


def bearing(widest=0.0, *, dimension=2, sides=None, n=(60, 19), U=0.5 * D * OMEGA, **more):
    """The journal of the `journal` scene as a bearing of shapes; its widest gap at an angle (degrees)."""
    shape = {"shape": "journal", "c": C, "eccentricity": E, "widest": np.pi * D * widest / 360}
    size = {"dimension": 2, "width": B, "ny": n[1]} if dimension == 2 else {}
    data = {"family": "bearing", "L": np.pi * D, "U": U, "nx": n[0], "fluid": {"mu": MU}, "film": [shape], **size, **more}
    return load_scene({**data, **({"sides": sides} if sides else {})})


@pytest.mark.parametrize("dimension, name", [(1, "long_journal"), (2, "journal")])
def test_a_bearing_with_a_journal_is_a_journal(dimension, name):
    """The force, not the integral of the pressure, which is a quarter larger."""
    changes = {"n": 60} if dimension == 1 else {"nx": 60, "ny": 19}
    ours, known = found(bearing(dimension=dimension)), found(load_scene(name, {**changes, "eccentricity": E}))
    for key in ("load", "force", "attitude_deg", "friction_coefficient", "pressure_integral"):
        assert ours[key] == pytest.approx(known[key], rel=1e-9), key
    assert ours["load"] == pytest.approx(np.hypot(*ours["force"]), rel=1e-13) and ours["load"] < 0.9 * ours["pressure_integral"]


RING = {"west": "periodic", "east": "periodic", "south": 2e5, "north": 2e5}


def test_the_force_turns_with_the_shaft():
    """A ring without a groove knows no x = 0: turned by whole points, the force turns along, load and attitude stay."""
    first, turned = (found(bearing(widest, sides=RING)) for widest in (0.0, 90.0))
    assert turned["load"] == pytest.approx(first["load"], rel=1e-7)
    assert turned["attitude_deg"] == pytest.approx(first["attitude_deg"], rel=1e-7)
    a, b = first["force"]
    assert turned["force"] == pytest.approx([-b, a], rel=1e-6)


def test_attitude_of_the_long_bearing():
    """tan(attitude) = pi sqrt(1 - e^2)/(2 e) for half a film would be 69.8; the one that conserves mass is known exactly."""
    assert found(bearing(dimension=1, n=(1000, 1)))["attitude_deg"] == pytest.approx(58.296185, rel=1e-5)


def test_balance_finds_the_force():
    """'eccentricity carries 5 kN' is about the bearing force, as in the journal scene."""
    base = bearing(n=(31, 9)).model_dump(exclude_unset=True)
    ours = solve(load_scene({**base, "balance": {"load": 5e3, "vary": "film.journal.eccentricity"}}))
    journal = solve(load_scene("journal", {"nx": 31, "ny": 9, "balance.load": 5e3}))
    assert ours.converged and journal.converged
    assert as_dict(ours)["load"] == pytest.approx(5e3, rel=2e-6)
    assert ours.settings["balance"]["value"] == pytest.approx(journal.settings["balance"]["value"], rel=1e-4)
    for solution in (ours, journal):
        solution.destroy()


ROUND_SHAFTS = [(dimension, sense) for dimension in (1, 2) for sense in (1, -1)]


@pytest.mark.parametrize("film", ["two_groove_journal", "mixed_journal", "hybrid_journal", *ROUND_SHAFTS], ids=str)
def test_the_force_alone_is_the_force_told(film):
    scene = load_scene(film) if isinstance(film, str) else bearing(dimension=film[0], U=film[1] * 0.5 * D * OMEGA)
    with solve(scene) as solution:
        assert [*shaft_force(solution.problem, solution.fields)] == solution.numbers["force"]


def test_moments():
    """A wedge that gets thinner to the east carries its load behind the middle; a tilted one beside it; a shaft tilted along
    its axis is turned back."""
    flat = {"family": "bearing", "dimension": 2, "L": 0.1, "width": 0.1, "U": 5.0, "fluid": {"mu": 0.02}, "nx": 21, "ny": 17}
    wedge = {"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}
    across = {"shape": "linear", "along": "y", "h_start": 0.0, "h_end": 1e-5}
    straight, tilted = (found(load_scene({**flat, "film": film})) for film in ([wedge], [wedge, across]))
    assert straight["moment"][1] < 0 and abs(straight["moment"][0]) < 1e-9 * abs(straight["moment"][1])
    assert tilted["moment"][0] < -1e-3 * tilted["load"]  # the thinner half is the southern one
    line = found(load_scene({**{k: v for k, v in flat.items() if k not in ("dimension", "width", "ny")}, "film": [wedge]}))
    assert isinstance(line["moment"], float) and line["moment"] < 0 and "force" not in line
    shaft = bearing()
    data = shaft.model_dump(exclude_unset=True)
    skew = found(load_scene({**data, "film": [*data["film"], across]}))
    assert np.hypot(*skew["moment"]) > 1e-4 * skew["load"] and np.hypot(*found(shaft)["moment"]) < 1e-9


def test_ambient_pressure_is_no_load():
    """1 bar all round a flat film of one thickness carries nothing, and adds nothing to a shaft's load."""
    base = {"family": "bearing", "dimension": 2, "L": 0.1, "width": 0.1, "U": 5.0, "nx": 9, "ny": 7}
    film = {"fluid": {"mu": 0.02, "p_supply": 1e5}, "film": [{"shape": "constant", "h": 2e-5}]}
    assert found(load_scene({**base, **film}))["load"] == pytest.approx(0.0, abs=1e-9)
    sides = dict.fromkeys(("south", "north"), "closed")
    moved = found(bearing(n=(40, 9), sides=sides, fluid={"mu": MU, "p_c": 3e5}))
    assert moved["load"] == pytest.approx(found(bearing(n=(40, 9), sides=sides))["load"], rel=1e-9)


def test_corners_of_unequal_pressure():
    """The side leakage grows by the same amount at every halving of the spacings, and the run says by how much."""
    sides = {"west": 2e5, "east": 3e5, "south": 0.0, "north": 1e5}
    flat = {"family": "bearing", "dimension": 2, "L": 0.1, "width": 0.08, "U": 5.0, "fluid": {"mu": MU}, "sides": sides}
    film = [{"shape": "constant", "h": 2e-5}]
    runs = [found(load_scene({**flat, "film": film, "nx": n, "ny": n})) for n in (31, 63)]
    steps = {side: runs[1]["flow"][side] - runs[0]["flow"][side] for side in sides}
    growth = runs[1]["flow_growth"]
    assert steps == pytest.approx(growth, rel=2e-2, abs=1e-3 * growth["south"])
    assert growth["south"] > growth["north"] > 0 > growth["west"] > growth["east"]
    assert sum(growth.values()) == pytest.approx(0.0, abs=1e-9 * growth["south"])
    assert "these flows have no limit" in summary(runs[-1])
    even = found(load_scene("journal", {"nx": 31, "ny": 9}))
    assert even["flow_growth"] is None and "no limit" not in summary(even)


def test_a_supply_that_reaches_a_side():
    """What it gives to a side at its own end doubles with every halving of the spacings, and the run says so."""
    groove = {"shape": "axial_groove", "x": [0.04, 0.06], "p": 5e5}
    pad = {"family": "bearing", "dimension": 2, "L": 0.1, "width": 0.08, "U": 1.0, "fluid": {"mu": MU}, "nx": 19}
    film = [{"shape": "constant", "h": 2e-5}]
    runs = [found(load_scene({**pad, "film": film, "supply": [groove], "ny": n})) for n in (79, 159)]
    growth = runs[0]["flow_growth"]
    assert growth["south"] == pytest.approx(growth["north"], rel=1e-9) and growth["west"] == growth["east"] == 0.0
    assert runs[1]["flow"]["south"] - runs[0]["flow"]["south"] == pytest.approx(growth["south"], rel=0.02)
    assert "these flows have no limit" in summary(runs[0])
    landed = found(load_scene({**pad, "film": film, "supply": [{**groove, "length": 0.06}], "ny": 39}))
    assert landed["flow_growth"] is None


def test_fluids_that_depend_on_pressure_keep_the_force():
    data = bearing(n=(40, 9)).model_dump(exclude_unset=True)
    plain, barus = (found(load_scene({**data, "fluid": {"mu": MU, "barus": b}})) for b in (0.0, 1e-10))
    assert barus["force"] == pytest.approx(plain["force"], rel=1e-2) and barus["force"] != plain["force"]


def pad(film, **more):
    return load_scene({"family": "bearing", "L": 0.1, "U": 5.0, "fluid": {"mu": 0.02}, "n": 399, "film": film, **more})


def test_all_fronts_are_told():
    """Three waves rupture three times; each front is where the film alone would have it, a third of the length apart."""
    waves = found(pad([{"shape": "sinusoid", "h_min": 1e-5, "h_max": 3e-5, "waves": 3}]))
    assert len(waves["ruptures"]) == 3 and len(waves["reformations"]) == 2
    assert waves["rupture"] == waves["ruptures"][0] and waves["reformation"] == waves["reformations"][0]
    fronts = np.sort(np.concatenate([waves["ruptures"], waves["reformations"]]))
    assert list(fronts[::2]) == waves["ruptures"]
    text = summary(waves)
    assert text.count("ruptures ") == 1 and all(f"{1e3 * x:.5g}" in text for x in waves["ruptures"])
    many = found(pad([{"shape": "sinusoid", "h_min": 1e-5, "h_max": 3e-5, "waves": 8}]))
    assert f"{len(many['ruptures'])} ruptures from " in summary(many) and len(many["ruptures"]) > 4


def test_void_that_enters_has_no_rupture():
    """The cavity begins outside: what is told is where it ends, and never a place before the film."""
    wedge = [{"shape": "linear", "h_start": 3e-5, "h_end": 1e-5}]
    data = found(pad(wedge, sides={"west": {"p": 0.0, "r": 0.4}}))
    assert data["rupture"] is None and data["ruptures"] == []
    assert 0 <= data["reformation"] < 0.1 and data["reformations"] == [data["reformation"]]
    assert "reformation " in summary(data) and "rupture " not in summary(data)
    divergent = found(pad([{"shape": "linear", "h_start": 1e-5, "h_end": 3e-5}]))
    assert len(divergent["ruptures"]) == 1 and 0 <= divergent["rupture"] < 0.1 / 400


def test_no_rescue(cli):
    """A flag forbids that another method's answer stands under the name of the one that was asked for."""
    words = ("solve", "problem4", "--n", 24, "--set", "p_side=1e6", "--method", "active-set", "--set", "active-set.give_up=1")
    rescued, refused = cli(*words, "--json"), cli(*words, "--no-rescue", "--json")
    assert rescued.status == 0 and rescued.json["took_over"] == "pivoting" and rescued.json["method"] == "active-set"
    assert refused.status == 1 and refused.json["took_over"] is None and refused.json["outcome"] == "stalled"


def test_three_ranks_find_the_same(cli):
    words = ("solve", "journal", "--nx", 31, "--ny", 6, "--set", "p_a=1e5", "--json")
    one, three = (cli(*words, ranks=ranks).json for ranks in (1, 3))
    for key in ("force", "attitude_deg", "ruptures", "reformations", "flow_growth"):
        assert three[key] == pytest.approx(one[key], rel=1e-6), key
    assert three["moment"] == pytest.approx(one["moment"], abs=1e-6 * one["load"] * B)


def test_a_march_in_time_is_never_warm(cli, tmp_path):
    table = tmp_path / "s.csv"
    cli("sweep", "squeeze", "--n", 19, "--set", "steps=8", "--vary", "p_wall=0.02,0.025", "--output", table)
    assert [row["start"] for row in csv.DictReader(table.read_text().splitlines())] == ["cold", "cold"]
