"""Sweeps: the axes' grammar, rows that equal single solves, warm starts, resumed files, failures as rows."""

import csv
import io
import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import solve
from lcp_lube.cli.arguments import parse
from lcp_lube.cli.axes import Axis, chains, parse_axis, points
from lcp_lube.cli.sweep import run as run_command
from lcp_lube.cli.sweep import sweep
from lcp_lube.errors import InputError
from lcp_lube.output.sweep_picture import by_ratios, figure_of
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.scene import load_scene

JOURNAL = {"nx": 31, "ny": 9}


def table(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.parametrize(
    "text, key, values",
    [
        ("U=1:3:3", "U", (1, 2, 3)),
        ("U=1:2:3", "U", (1.0, 1.5, 2.0)),
        ("U=2:1:2", "U", (2, 1)),
        ("U=0.5:0.5:1", "U", (0.5,)),
        ("mu=1e-3:1e-1:3:log", "mu", (1e-3, 1e-2, 1e-1)),
        ("n=50:200:4", "n", (50, 100, 150, 200)),
        ("n=50,7", "n", (50, 7)),
        ("scheme=face,nodal", "scheme", ("face", "nodal")),
        ("journal.eccentricity=0.1,0.2", "journal.eccentricity", (0.1, 0.2)),
        ("speed_rpm=1000 rpm:3e3rpm:2", "speed_rpm", (1000.0, 3000.0)),
        ("wave=[0.1, 0.2],[0.3, 0.4]", "wave", ([0.1, 0.2], [0.3, 0.4])),
    ],
)
def test_axes(text, key, values):
    axis = parse_axis(text)
    assert axis.key == key
    np.testing.assert_array_equal(axis.values, values)
    assert [type(a) for a in axis.values] == [type(b) for b in values]


@pytest.mark.parametrize(
    "text",
    ["U", "U=", "=1", "U=1:2", "U=1:2:0", "U=1:2:1.5", "U=1:2:3:lin", "U=1:2:3:4:5", "U=0:1:3:log", "U=a:b:3", "U=1:inf:3"],
)
def test_axes_that_are_none(text):
    with pytest.raises(InputError, match="--vary"):
        parse_axis(text)


@given(st.lists(st.integers(1, 4), min_size=1, max_size=3))
def test_the_product_of_the_axes(counts):
    """Every combination once, the last axis fastest; chains are lines along it, or points."""
    axes = [Axis(f"k{k}", tuple(range(n))) for k, n in enumerate(counts)]
    at = points(axes)
    assert [tuple(point.values()) for point in at] == list(np.ndindex(*counts))
    for warm, length in ((True, counts[-1]), (False, 1)):
        pieces = chains(axes, warm)
        assert [k for piece in pieces for k in piece] == list(range(len(at))) and {len(piece) for piece in pieces} == {length}
        assert all(len({tuple(at[k].values())[:-1] for k in piece}) == 1 for piece in pieces)


def run(axes, warm=True, path=None, settings="", changes=JOURNAL, **choices):
    """A sweep of the journal, and the starts that its solves were given."""
    starts = []

    def scene_at(point):
        return load_scene("journal", {**changes, **point})

    def solve_at(point, near):
        starts.append(near.fields if near else None)
        return solve(scene_at(point), start=near, **choices)

    rows, columns = sweep(axes, scene_at, solve_at, path, warm, settings)
    return rows, columns, starts


def test_rows_equal_single_solves_and_warm_starts_save_steps():
    axes = [Axis("width_over_diameter", (0.5, 1.0)), Axis("eccentricity", (0.2, 0.4, 0.6, 0.8))]
    warm, columns, starts = run(axes, method="active-set")  # nonlinear multigrid has its own start from coarse grids
    cold, _, none = run(axes, warm=False, method="active-set")
    assert [start is None for start in starts] == 2 * [True, False, False, False] and none == 8 * [None]
    assert columns[:2] == ["width_over_diameter", "eccentricity"]
    for a, b in zip(warm, cold, strict=True):
        assert a["outcome"] == b["outcome"] == "converged"
        for key in ("p_max", "load", "friction", "sommerfeld", "flow_south", "p_max_x", "force_y"):
            assert a[key] == pytest.approx(b[key], rel=1e-9)
    single = solve(load_scene("journal", {**JOURNAL, "eccentricity": 0.6}))
    assert warm[6]["load"] == pytest.approx(single.problem.quantities(single.fields)["load"], rel=1e-7)
    single.destroy()
    # Counted, not timed, on the wide ones: 1 or 2 steps from a near neighbour, 2 or 3 without one.
    axes[1] = Axis("eccentricity", (0.56, 0.58, 0.6, 0.62))
    (warm, *_), (cold, *_) = (run(axes, warm=way, method="active-set") for way in (True, False))
    assert sum(row["iterations"] for row in warm[5:]) < 0.6 * sum(row["iterations"] for row in cold[5:])


def test_a_new_line_starts_by_itself():
    """No line needs another one: they may be solved side by side, and their rows are the same."""
    axes = [Axis("width_over_diameter", (0.5, 1.0)), Axis("eccentricity", (0.2, 0.4, 0.9))]
    rows, _, starts = run(axes)
    assert [start is None for start in starts] == [True, False, False] * 2
    assert [row["start"] for row in rows] == ["cold", "warm", "warm"] * 2


def test_grids_may_be_varied():
    rows, _, starts = run([Axis("nx", (20, 31, 47))])
    assert [row["nx"] for row in rows] == [20, 31, 47] and starts[1] is not None


def test_resumed(tmp_path):
    """What stands in the file is not solved again, unless its data or settings are others; new points are added."""
    path = tmp_path / "s.csv"
    _, _, starts = run([Axis("eccentricity", (0.2, 0.4))], path=path)
    assert len(starts) == 2
    rows, _, starts = run([Axis("eccentricity", (0.2, 0.4, 0.6))], path=path)
    assert len(starts) == 1 and [row["eccentricity"] for row in rows] == ["0.2", "0.4", "0.6"]
    assert len(table(path.read_text())) == 3 == len(rows)
    assert run([Axis("eccentricity", (0.2,))], path=path, settings="others")[2] == [None]
    assert run([Axis("eccentricity", (0.2,))], path=path, changes={**JOURNAL, "nx": 30})[2] == [None]
    assert len(table(path.read_text())) == 5 and list(tmp_path.iterdir()) == [path]


def test_a_failed_point_is_a_row_and_no_start():
    """A run that ends at its iteration limit, and the one behind it: started from the last one that converged."""
    nears = []

    def scene_at(point):
        return load_scene("journal", {**JOURNAL, **point})

    def solve_at(point, near):
        nears.append(near and near.problem.film.parts[0].eccentricity)
        limit = 1 if point["eccentricity"] == 0.4 else 99
        return solve(scene_at(point), start=near, method="din", stopping={"max_it": limit})

    rows, columns = sweep([Axis("eccentricity", (0.2, 0.4, 0.6))], scene_at, solve_at)
    assert [row["outcome"] for row in rows] == ["converged", Outcome.MAX_ITERATIONS, "converged"]
    # The second one was begun anew when its neighbour's answer led nowhere.
    assert nears == [None, 0.2, 0.2] and [row["start"] for row in rows] == ["cold", "cold", "warm"]
    assert {"outcome", "message", "load"} <= set(columns)


def test_a_refused_point_is_a_row():
    """What only the solve notices; where all points are refused, so is the sweep."""

    def scene_at(point):
        return load_scene("journal", {**JOURNAL, **point})

    def solve_at(point, near):
        if point["eccentricity"] > 0.3:
            raise InputError("no such film")
        return solve(scene_at(point), start=near)

    rows, _ = sweep([Axis("eccentricity", (0.4, 0.2))], scene_at, solve_at)
    assert [row["outcome"] for row in rows] == ["refused", "converged"] and rows[0]["message"] == "no such film"
    with pytest.raises(InputError, match="no such film"):
        sweep([Axis("eccentricity", (0.4, 0.5))], scene_at, solve_at)


def test_a_sweep_of_loads(cli):
    """Each row is a balance, which begins at its neighbour's eccentricity."""
    done = cli("sweep", "journal", "--nx", 31, "--ny", 9, "--vary", "balance.load=1e3,2e3,4e3")
    rows = table(done.out)
    assert done.status == 0 and [float(row["load"]) for row in rows] == pytest.approx([1e3, 2e3, 4e3], rel=2e-6)
    values = [float(row["balance_value"]) for row in rows]
    assert values == sorted(values) and int(rows[2]["balance_solves"]) <= 5


def test_command(cli, tmp_path):
    done = cli("sweep", "journal", "--nx", 31, "--ny", 9, "--vary", "journal.eccentricity=0.2:0.6:3")
    rows = table(done.out)
    assert done.status == 0 and done.lines == [
        f"sweep: 3 points, 0 failed, {sum(int(row['iterations']) for row in rows)} iterations"
    ]
    single = cli("solve", "journal", "--nx", 31, "--ny", 9, "--set", "eccentricity=0.4", "--json").json
    for key in ("load", "sommerfeld", "attitude_deg", "friction_coefficient", "power_loss", "side_leakage"):
        assert float(rows[1][key]) == pytest.approx(single[key], rel=1e-6)
    assert json.loads(f"[{rows[1]['p_max_x']}, {rows[1]['p_max_y']}]") == pytest.approx(single["p_max_at"])


def test_command_with_a_file_a_failure_and_several_ranks(cli, tmp_path):
    words = ["sweep", "journal", "--ny", 9, "--vary", "eccentricity=0.2,0.6", "--vary", "nx=15,31", "--output", "s.csv"]
    done = cli(*words, "--method", "din", "--max-it", 12, "--no-warm", ranks=2)
    assert done.status == 1 and done.out == ""
    rows = table((tmp_path / "s.csv").read_text())
    assert {row["outcome"] for row in rows} == {"max_iterations"}
    assert cli(*words).status == 0
    assert len(table((tmp_path / "s.csv").read_text())) == 8


@pytest.mark.parametrize(
    "words, message",
    [
        (["--vary", "eccentricity=0.5,1.5"], "journal: eccentricity = 1.5: allowed is less than 1"),
        (["--vary", "eccentrisity=0.5"], "journal: unknown key eccentrisity; nearest is eccentricity"),
        (["--vary", "eccentricity=0.5", "--vary", "eccentricity=0.6"], "--vary eccentricity: given twice"),
        (["--vary", "eccentricity=0:0.9:1000", "--vary", "psi=1e-3:2e-3:1000"], "--vary: 1000000 points; at most 100000"),
        (["--vary", "eccentricity=0.5", "--output", "s.txt"], "--output s.txt: a sweep writes a .csv"),
        (["--vary", "eccentricity=0.5", "--output", "/proc/s.csv"], "/proc/s.csv"),
    ],
)
def test_bad_input_is_refused_before_anything_is_solved(words, message):
    args = parse(["sweep", "journal", "--nx", "31", "--ny", "9", *words])
    with pytest.raises(InputError, match=re.escape(message)):
        run_command(args)


def test_units_of_an_axis():
    axis = parse_axis("h_min=10um:20um:3")
    assert axis.values == (1e-5, 1.5e-5, 2e-5) and load_scene("problem1", {"h_min": axis.given(1.5e-5)}).h_min == 1.5e-5
    assert parse_axis("p_a=1bar,0.5 MPa").values == (1e5, 5e5) and parse_axis("U=1,2.5").unit == ""


def test_rows_say_what_was_solved(cli, tmp_path):
    """Rows of different scenes in one file differ in a column, whatever was changed."""
    for change in ("mu=10mPas", "mu=0.02"):
        assert cli("sweep", "problem1", "--n", 20, "--set", change, "--vary", "U=1:2:2", "--output", "s.csv").status == 0
    by_din = ("--method", "din", "--set", "din.gamma=0.3")
    assert cli("sweep", "problem1", "--n", 20, *by_din, "--vary", "U=1:2:2", "--output", "s.csv").status == 0
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["scene.mu [Pa s]"] for row in rows] == ["0.01", "0.01", "0.02", "0.02", "0.015", "0.015"]
    assert [row["scene.U [m/s]"] for row in rows] == ["1.0", "2.0"] * 3 and "gamma" in rows[-1]["settings"]


def test_rows_of_another_layout_are_refused(cli, tmp_path):
    words = ["sweep", "problem1", "--n", 20, "--vary", "U=1:2:2", "--output", "s.csv"]
    assert cli(*words).status == 0
    path = tmp_path / "s.csv"
    text = path.read_text()
    rows = table(text)
    for change, message in (
        (
            lambda row: {name: value for name, value in row.items() if not name.startswith("scene.mu")},
            "without the column 'scene.mu",
        ),
        (lambda row: {**row, "scene.old": "1"}, "with a column 'scene.old'"),
    ):
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(change(rows[0])))
            writer.writeheader()
            writer.writerows(map(change, rows))
        before = path.read_text()
        done = cli(*words)
        assert done.status == 2 and message in done.err and "s.csv" in done.err and done.err.count("\n") == 1
        assert path.read_text() == before


def test_picture(cli, tmp_path):
    """A line for each value of the first key; what failed is a cross, what is no number of the runs is refused by name."""
    words = ["sweep", "problem1", "--n", 20, "--vary", "mu=0.01,0.02", "--vary", "U=1:100:3:log", "--output", "s.csv"]
    done = cli(*words, "--plot", "s.png", "--quantity", "load,p_max,friction_coefficient")
    assert done.status == 0 and (tmp_path / "s.png").stat().st_size > 10_000
    refused = cli(*words, "--plot", "t.png", "--quantity", "p_mex")
    assert refused.status == 2 and "p_max" in refused.err and not (tmp_path / "t.png").exists()
    failing = cli(*words[:-2], "--method", "din", "--max-it", 12, "--no-rescue", "--plot", "u.png")
    assert failing.status == 1 and (tmp_path / "u.png").exists()


def test_a_number_that_is_zero_is_drawn():
    """From a file, as a text, and as it was made; what did not converge, and no number, are not."""
    rows = [{"U": 1.0, "r": r, "converged": True} for r in (0.0, "0.0", "", None, True)] + [
        {"U": 1.0, "r": 0.0, "converged": False}
    ]
    line = figure_of([dict(row, U=float(k)) for k, row in enumerate(rows)], ["U"], ["r"], {}, "").axes[0].lines[0]
    assert list(np.isfinite(np.asarray(line.get_ydata(), dtype=float))) == [True, True, False, False, False, False]


def test_values_at_equal_ratios():
    assert by_ratios([1.0, 10.0, 100.0]) and by_ratios([float(f"{x:.4g}") for x in np.geomspace(3.0, 700.0, 9)])
    assert not any(map(by_ratios, ([1.0, 2.0, 3.0], [1.0, 4.0], [-1.0, 1.0, 3.0], ["sinusoid", "parabola", "line"], [5.0] * 3)))
