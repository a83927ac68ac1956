"""Fields in files and pictures: what is written is what was solved, on any number of ranks; a failure leaves nothing."""

import json
import os
import re
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import Run
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from petsc4py import PETSc

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.output import files, panels, picture
from lcp_lube.output.plot import draw, plot
from lcp_lube.output.units import prefix
from lcp_lube.problems.solution import Outcome, Solution
from lcp_lube.scenes.scene import load_scene

HDF5 = PETSc.Sys.hasExternalPackage("hdf5")
SCENES = {"problem2": {"n": 11}, "problem4": {"nx": 11, "ny": 7}}
Fields = dict[str, np.ndarray]


@pytest.fixture(scope="module", params=SCENES)
def solution(request: pytest.FixtureRequest) -> Iterator[Solution]:
    """A solved problem, in 1D and in 2D, on this process."""
    solved = solve(load_scene(request.param, SCENES[request.param]))
    yield solved
    solved.destroy()


@pytest.fixture
def line() -> Iterator[Solution]:
    solved = solve(load_scene("problem2", {"n": 60}))
    yield solved
    solved.destroy()


def expected(solution: Solution) -> Fields:
    """p, r, h and the coordinates as they should stand in a file."""
    grid = solution.problem.grid
    fields = {
        name: values.reshape(grid.shape[::-1]) for name, (values, _) in solution.problem.physical(solution.fields).items()
    }
    places = {a: (1 + np.arange(n)) * L / (n + 1) for a, n, L in zip("xy", grid.shape, grid.lengths, strict=False)}
    return fields | places


def assert_same(found: Fields, wanted: Fields, rtol: float = 0.0) -> None:
    for name, values in wanted.items():
        assert found[name].shape == values.shape
        np.testing.assert_allclose(found[name], values, rtol=1e-15 if name in "xy" else 0.0, atol=rtol * np.abs(values).max())


def read_vtk(path: Path) -> Fields:
    """Point data and coordinates of a .vts or .vtr, pieces put together; a reader of its own, from VTK's description."""
    content = path.read_bytes()
    head, _, data = content.partition(b'<AppendedData encoding="raw">')
    data = data[data.index(b"_") + 1 :]
    text = head.decode()
    word = np.dtype("<u8" if 'header_type="UInt64"' in text else "<u4")
    extent = re.search(r'WholeExtent="([\d ]+)"', text)
    assert extent is not None
    x1, y1 = (int(k) for k in extent[1].split()[1:4:2])
    whole: Fields = {}
    for bounds, piece in re.findall(r'<Piece Extent="([\d ]+)">(.*?)</Piece>', text, re.DOTALL):
        i0, i1, j0, j1 = (int(k) for k in bounds.split()[:4])
        here = np.s_[j0 : j1 + 1, i0 : i1 + 1]
        for name, offset in re.findall(r'Name="(\w+)".*?offset="(\d+)"', piece):
            start = int(offset) + word.itemsize
            size = int(np.frombuffer(data, word, 1, int(offset))[0])
            values = np.frombuffer(data, "<f8", size // 8, start)
            box = (j1 - j0 + 1, i1 - i0 + 1)
            if name == "Position":
                points = values.reshape(*box, 3)
                parts = {"x": points[:, :, 0], "y": points[:, :, 1]}
            elif name.endswith("coord"):
                axis = name[0].lower()
                parts = {axis: np.broadcast_to(values[:, None] if axis == "y" else values, box)} if axis != "z" else {}
            else:
                parts = {name: values.reshape(box)}
            for key, part in parts.items():
                whole.setdefault(key, np.full((y1 + 1, x1 + 1), np.nan))[here] = part
    assert not any(np.isnan(values).any() for values in whole.values()), "the pieces do not cover the grid"
    x, y = whole.pop("x"), whole.pop("y")
    assert np.ptp(x, axis=0).max() == 0 == np.ptp(y, axis=1).max()
    if y1 == 0:
        return {name: values[0] for name, values in whole.items()} | {"x": x[0]}
    return whole | {"x": x[0], "y": y[:, 0]}


def read_h5(path: Path, solution: Solution) -> Fields:
    """The datasets by PETSc's own reader on this process's grid."""
    grid = solution.problem.grid
    viewer = PETSc.Viewer().createHDF5(str(path), "r")
    out = {}
    for name in ("p", "r", "h"):
        vec = grid.dm.createGlobalVec()
        vec.setName(name)
        vec.load(viewer)
        out[name] = vec.array_r.reshape(grid.shape[::-1]).copy()
        vec.destroy()
    for name, n in zip("xy", grid.shape, strict=False):
        vec = PETSc.Vec().createMPI(n)
        vec.setName(name)
        vec.load(viewer)
        out[name] = vec.array_r.copy()
        vec.destroy()
    viewer.destroy()
    return out


def read(path: Path, solution: Solution) -> Fields:
    if path.suffix == ".npz":
        with np.load(path) as content:
            return {name: content[name] for name in content if name not in ("units", "result", "fronts")}
    return read_h5(path, solution) if path.suffix == ".h5" else read_vtk(path)


FORMATS = [".npz", ".vts", ".vtr", pytest.param(".h5", marks=pytest.mark.skipif(not HDF5, reason="PETSc without HDF5"))]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_gives_the_fields_back(solution: Solution, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"fields{suffix}"
    files.save(solution, path)
    assert_same(read(path, solution), expected(solution))
    assert list(tmp_path.iterdir()) == [path]


def test_npz_carries_units_and_the_result(solution: Solution, tmp_path: Path) -> None:
    files.save(solution, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as content:
        units, result = json.loads(str(content["units"])), json.loads(str(content["result"]))
        assert units | {"y": "m"} == {"p": "Pa", "r": "", "h": "m", "x": "m", "y": "m"}
        assert result["converged"] and result["p_max"] >= content["p"].max()


@pytest.mark.parametrize("scene", SCENES)
def test_files_of_three_ranks_equal_those_of_one(scene: str, cli: Callable[..., Run], tmp_path: Path) -> None:
    """Sizes that three ranks do not divide; .h5 is written by three ranks and read by one."""
    serial = solve(load_scene(scene, SCENES[scene]))
    targets = [f"fields{suffix}" for suffix in (".npz", ".vts", ".vtr", *([".h5"] if HDF5 else []))]
    size = [word for key, n in SCENES[scene].items() for word in (f"--{key}", n)]
    outputs = [word for target in targets for word in ("--output", target)]
    done = cli("solve", scene, *size, *outputs, "--plot", "picture.png", ranks=3)
    assert done.status == 0, done.err
    for target in targets:
        assert_same(read(tmp_path / target, serial), expected(serial), rtol=1e-10)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*targets, "picture.png"])
    serial.destroy()


def test_absolute_pressure_is_stored(tmp_path: Path) -> None:
    shifted = solve(load_scene("problem1", {"n": 9, "p_c": -3e4}))
    files.save(shifted, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as content:
        assert content["p"].min() == pytest.approx(-3e4)
    shifted.destroy()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(line: Solution, tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "a.npz"
    path.write_text("the old one")

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "open", full)
    with pytest.raises(InputError, match=r"a\.npz: could not be written: No space left"):
        files.save(line, path)
    assert path.read_text() == "the old one"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", [".vts", pytest.param(".h5", marks=pytest.mark.skipif(not HDF5, reason="no HDF5"))])
def test_a_folder_that_vanished_is_one_line(line: Solution, suffix: str, tmp_path: Path, capfd: Any) -> None:
    with pytest.raises(InputError, match=r"could not be written: No such file"):
        files.save(line, tmp_path / "gone" / f"a{suffix}")
    capfd.readouterr()  # HDF5 prints its own account


def test_an_interrupt_removes_the_temporary_file(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), files.replacing(tmp_path / "a.png", MPI.COMM_SELF) as temporary:
        Path(temporary).write_text("half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("of", [(Path, "touch"), (os, "replace")])
def test_an_interrupt_outside_the_block_removes_it_too(of: tuple[Any, str], tmp_path: Path, monkeypatch: Any) -> None:
    """Just after the file is made, or just before it gets its name."""
    make, seen = Path.touch, list[Path]()

    def interrupted(path: Path, *_: object) -> None:
        make(path)
        seen.extend(tmp_path.iterdir())
        raise KeyboardInterrupt

    monkeypatch.setattr(*of, interrupted)
    with pytest.raises(KeyboardInterrupt), files.replacing(tmp_path / "a.png", MPI.COMM_SELF) as temporary:
        Path(temporary).write_text("whole")
    assert len(seen) == 1 and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "as_plot", "message"),
    [
        ("a.vtk", False, r"extension \.vtk; allowed are \.npz, \.nc, .*; nearest is \.vts"),
        ("a", False, r"no extension; allowed are"),
        ("a.png", False, r"\.png is for --plot"),
        ("a.h5", True, r"allowed are \.png, \.pdf, \.svg; \.h5 is for --output"),
        ("a.pgn", True, r"nearest is \.png"),
        ("gone/a.npz", False, r"folder .*gone does not exist"),
        ("folder.npz", False, r"is a folder"),
    ],
)
def test_a_bad_target_is_refused(name: str, as_plot: bool, message: str, tmp_path: Path) -> None:
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(InputError, match=message) as refusal:
        files.check_target(tmp_path / name, plot=as_plot)
    assert "\n" not in str(refusal.value)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder that even root cannot write to")
def test_a_folder_that_cannot_be_written_to_is_refused() -> None:
    with pytest.raises(InputError, match=r"cannot be written in /proc"):
        files.check_target("/proc/a.npz")


def test_a_good_target_leaves_no_trace(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_text("the old one")
    for name in ("a.npz", "b.vts", "C.NPZ"):
        files.check_target(tmp_path / name)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["the old one"]


def test_missing_libraries_are_named(line: Solution, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(files, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install lcp-lube\[plot\]"):
        files.check_target(tmp_path / "a.png", plot=True)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"pip install lcp-lube\[plot\]"):
        plot(line, tmp_path / "a.png")
    without = SimpleNamespace(Sys=SimpleNamespace(hasExternalPackage=lambda name: False))
    monkeypatch.setattr(files, "PETSc", without)
    with pytest.raises(InputError, match=r"without HDF5; use \.npz"):
        files.check_target(tmp_path / "a.h5")


def test_the_command_line_refuses_before_it_solves(cli: Callable[..., Run]) -> None:
    done = cli("solve", "problem4", "--n", 2000, "--output", "a.vtk", timeout=20)  # too large to be solved in this time
    assert done.status == 2
    (line,) = done.lines
    assert line.startswith("lcp-lube: --output a.vtk: extension .vtk; allowed are .npz, ") and line.endswith("nearest is .vts")


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_pictures_are_files_of_their_kind_and_reproducible(
    solution: Solution, suffix: str, magic: bytes, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    paths = [tmp_path / f"{k}{suffix}" for k in "ab"]
    for path in paths:
        plot(solution, path)
    assert paths[0].read_bytes().startswith(magic)
    # But for the names that matplotlib gives to clip paths in SVG: they depend on when objects are freed.
    first, second = (re.sub(rb"#?p[0-9a-f]{10}", b"", path.read_bytes()) for path in paths)
    assert first == second


def drawn(axes: Any, label: str) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the line with this label."""
    line = next(line for line in axes.lines if line.get_label() == label)
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)


def test_a_line_picture_shows_fields_fronts_and_the_exact_solution(line: Solution) -> None:
    pytest.importorskip("matplotlib")
    shown = picture.collect(line)
    assert shown is not None and shown.exact is not None
    upper, lower, right = draw(shown).axes
    x, p = drawn(upper, "pressure p")
    np.testing.assert_allclose(x, np.concatenate([[0.0], shown.x, [0.1]]) * 1e3)
    np.testing.assert_allclose(p, np.concatenate([[1.0], line.fields["p"], [1.0]]))  # both ends at 1 MPa
    np.testing.assert_allclose(np.interp(x, *drawn(upper, "exact")), p, atol=0.02)
    # The void, at the faces, where the scheme knows it: that of the exact solution but for the cell that is full again.
    at, r = drawn(right, "void fraction r")
    away = np.abs(at / 1e3 - shown.quantities["reformation"]) > 2 * line.problem.grid.spacing[0]
    np.testing.assert_allclose(at[1:-1], (shown.x + 0.05 / 61) * 1e3)
    np.testing.assert_allclose(r[away], shown.exact.r(at / 1e3)[away], atol=3e-4)
    assert np.abs(line.fields["r"] - shown.exact.r(shown.x))[shown.x < 0.09].max() > 5e-3  # as at the points it is not
    texts = [text.get_text() for text in upper.texts]
    for name in ("rupture", "reformation"):
        assert f"{name}\n{1e3 * shown.quantities[name]:.4g} mm" in texts
    assert lower.get_xlabel() == "x (mm)"


JOURNALS = {"long_journal": {"n": 119}, "journal": {"nx": 59, "ny": 15}}


@pytest.mark.parametrize("scene", JOURNALS)
def test_a_journal_is_drawn_in_its_bush(scene: str) -> None:
    """The load downwards, the narrowest film behind it by the attitude angle, the pressure largest where p_max is."""
    pytest.importorskip("matplotlib")
    solved = solve(load_scene(scene, JOURNALS[scene]))
    shown = picture.collect(solved)
    assert shown is not None and shown.is_journal
    bearing = next(axes for axes in draw(shown).axes if "attitude angle" in axes.get_title())
    attitude = shown.quantities["attitude_deg"]
    assert bearing.get_title().startswith(f"attitude angle {attitude:.1f}°")
    journal = np.asarray(bearing.patches[-1].get_path().vertices)
    narrowest = journal[np.argmax(np.hypot(*journal.T))]
    assert np.degrees(np.arctan2(narrowest[1], narrowest[0])) == pytest.approx(attitude - 90.0, abs=1.0)
    pressure = np.stack([np.asarray(part) for part in bearing.lines[0].get_data()])
    peak = pressure[:, np.nanargmax(np.hypot(*pressure))]
    angle = 90.0 + attitude + 360.0 * shown.quantities["p_max_at"][0] / solved.problem.grid.lengths[0]
    off = (np.degrees(np.arctan2(peak[1], peak[0])) - angle + 180.0) % 360.0  # drawn at the points, told between them
    assert off == pytest.approx(180.0, abs=1.0 + 180.0 / solved.problem.grid.shape[0])
    labels = {axes.get_xlabel() for axes in draw(shown).axes}
    assert "angle from x = 0 (°)" in labels
    solved.destroy()


def test_the_section_of_a_map_names_the_fronts_of_the_middle_line() -> None:
    pytest.importorskip("matplotlib")
    solved = solve(load_scene("journal", {"nx": 59, "ny": 16}))  # no point on the middle line: the one below it
    shown = picture.collect(solved)
    assert shown is not None and shown.middle == 7
    rupture = 360.0 * shown.quantities["rupture"] / solved.problem.grid.lengths[0]
    titles = [axes.get_title(loc="left") for axes in draw(shown).axes]
    assert f"section at y = 47.06 mm (dashed), rupture {rupture:.4g}°" in titles
    solved.destroy()


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("journal", {"nx": 20, "ny": 9, "round": "periodic", "p_side": 1e5}),
        ("long_journal", {"n": 1}),
        ("pocketed_pad", {"n": 5, "sides.east": "closed", "scheme": "upwind"}),
        ("pocketed_pad", {"n": 5, "sides.west": "closed"}),
    ],
)
def test_sides_of_every_kind_are_drawn(scene: str, changes: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    solved = solve(load_scene(scene, changes))
    plot(solved, tmp_path / "a.png")
    plot(solved, tmp_path / "a.svg")
    shown = picture.collect(solved)
    assert shown is not None
    x, p = panels.pressure_line(shown, None if shown.y.size == 0 else shown.middle)
    start, length = solved.problem.grid.origin[0], solved.problem.grid.lengths[0]
    assert (x[0], x[-1]) == pytest.approx((start, start + length)) and np.isfinite(p).all()
    if changes.get("round"):
        assert p[0] == p[-1]
    solved.destroy()


def test_a_png_is_small(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    solved = solve(load_scene("journal", {"nx": 119, "ny": 39}))
    plot(solved, tmp_path / "a.png")
    with image.open(tmp_path / "a.png") as content:
        assert content.mode == "P" and content.size[0] > 1000
        colours = {tuple(colour) for _, colour in content.convert("RGB").getcolors(1 << 20)}
    assert {(0, 114, 178), (213, 94, 0)} <= colours  # the lines' own
    assert (tmp_path / "a.png").stat().st_size < 100_000
    solved.destroy()


def test_a_failed_run_says_so_in_its_title(line: Solution) -> None:
    shown = picture.collect(line)
    assert shown is not None
    assert "6.6" in picture.title(shown) and "NOT" not in picture.title(shown)
    line.outcome = Outcome.MAX_ITERATIONS
    assert "NOT a solution, the iteration limit was reached" in picture.title(shown)


@pytest.mark.parametrize("scene", [*SCENES, *JOURNALS])
@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_useless_fields_are_drawn_all_the_same(scene: str, value: float, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    solved = solve(load_scene(scene, {**SCENES, **JOURNALS}[scene]))
    solved.fields["p"][:] = solved.fields["r"][:] = value
    plot(solved, tmp_path / "a.png")
    solved.destroy()


def test_large_fields_are_thinned_before_they_are_gathered(monkeypatch: Any) -> None:
    solved = solve(load_scene("problem4", {"nx": 23, "ny": 12}))
    monkeypatch.setattr(picture, "MOST_POINTS", {2: 5})
    shown = picture.collect(solved)
    assert shown is not None
    whole = expected(solved)
    assert shown.fields["p"][0].shape == shown.sign.shape == (4, 5)
    np.testing.assert_array_equal(shown.fields["p"][0], whole["p"][1::3, 1::5])
    np.testing.assert_allclose(shown.x, whole["x"][1::5])
    solved.destroy()


def test_problems_of_another_kind_are_stored_and_drawn(tmp_path: Path) -> None:
    """Files and pictures ask for names, values and units, not for p and r."""
    pytest.importorskip("matplotlib")
    other = solve(load_scene("bratu", {"n": 9}))
    files.save(other, tmp_path / "a.npz")
    plot(other, tmp_path / "a.png")
    with np.load(tmp_path / "a.npz") as content:
        assert content["v"].shape == (9, 9)
    other.destroy()


@given(n=st.integers(1, 5000), step=st.integers(1, 600))
def test_a_stride_takes_points_as_far_from_both_ends(n: int, step: int) -> None:
    points = files.taken(n, step)
    assert points.size == -(-n // step)
    assert np.all(np.diff(points) == step)
    assert 0 <= (n - 1 - points[-1]) - points[0] <= 1


@given(st.floats(1e-9, 9.99e11))
def test_a_prefix_brings_numbers_to_three_digits(value: float) -> None:
    factor, unit = prefix(value, "Pa")
    assert 1 - 1e-9 <= value * factor < 1000
    assert unit.endswith("Pa")


def test_boundary_on_the_command_line(cli, tmp_path):
    assert cli("solve", "problem1", "--n", 20, "--output", "a.npz", "--boundary").status == 0
    with np.load(tmp_path / "a.npz") as saved:
        assert saved["p"].shape == saved["x"].shape == (22,)
    done = cli("solve", "problem1", "--n", 20, "--boundary")
    assert done.status == 2 and done.err == "lcp-lube: --boundary: --output FILE is needed\n"
