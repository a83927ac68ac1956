"""Round trips: what is written is opened by the program that it is for, where that is installed, and says the same."""

import json
import math
import xml.etree.ElementTree as xml
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lcp_lube import InputError, Solution, load_scene, save_series, solve, to_pandas

WAVE = {"family": "bearing", "dimension": 2, "L": 1e-3, "width": 5e-4, "U": 1.0, "nx": 15, "ny": 7, "fluid": {"mu": 0.01}}


@pytest.fixture(scope="module")
def plane() -> Iterator[Solution]:
    with solve("problem4", nx=13, ny=9) as solution:
        yield solution


@pytest.fixture(scope="module")
def line() -> Iterator[Solution]:
    with solve("problem1", n=21) as solution:
        yield solution


@pytest.mark.parametrize("boundary", [False, True])
@pytest.mark.parametrize("which", ["plane", "line"])
def test_netcdf_in_xarray(which: str, boundary: bool, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    solution: Solution = request.getfixturevalue(which)
    solution.save(tmp_path / "film.nc", boundary=boundary)
    with xarray.open_dataset(tmp_path / "film.nc") as data:
        for name in "prh":
            np.testing.assert_array_equal(data[name].values, solution.field(name, boundary))
            assert data[name].attrs["units"] == (solution.units[name] or "1")
        assert data["p"].dims == (("y", "x") if which == "plane" else ("x",))
        assert data["x"].attrs == {"units": "m", "long_name": "distance in the direction of motion", "axis": "X"}
        assert float(data["load"]) == solution.load and data["load"].attrs["units"] == solution.units["load"]
        assert data.attrs["Conventions"].startswith("CF-")
        assert json.loads(data.attrs["result"])["load"] == solution.load
        same = solution.to_xarray(boundary)
        assert same["p"].equals(data["p"].drop_vars([name for name in data["p"].coords if name not in "xy"]))


def test_netcdf_on_the_command_line_on_ranks(cli: Any, tmp_path: Path) -> None:
    from scipy.io import netcdf_file

    for ranks in (1, 2, 3):
        done = cli("solve", "problem4", "--nx", 13, "--ny", 9, "--method", "active-set", "--output", f"{ranks}.nc", ranks=ranks)
        assert done.status == 0, done.err
    found = []
    for ranks in (1, 2, 3):
        with netcdf_file(tmp_path / f"{ranks}.nc", mmap=False) as file:
            found.append(file.variables["p"][:].copy())
    for p in found[1:]:
        np.testing.assert_allclose(p, found[0], rtol=1e-8, atol=1e-8 * found[0].max())


def test_series_names_its_files(line: Solution, tmp_path: Path) -> None:
    save_series({0.5: line, 1.0: line}, tmp_path / "two.pvd")
    entries = xml.parse(tmp_path / "two.pvd").getroot().iter("DataSet")
    assert [(float(e.attrib["timestep"]), e.attrib["file"]) for e in entries] == [(0.5, "two_0000.vts"), (1.0, "two_0001.vts")]
    assert {path.name for path in tmp_path.iterdir()} == {"two.pvd", "two_0000.vts", "two_0001.vts"}
    with pytest.raises(InputError, match=r"\.pvd"):
        save_series({}, tmp_path / "none.pvd")


def test_series_in_paraviews_reader(plane: Solution, tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    with solve("problem4", nx=13, ny=9, U=2.0) as slow:
        save_series({1.0: slow, 5.0: plane}, tmp_path / "speeds.pvd", boundary=True)
    reader = pyvista.get_reader(tmp_path / "speeds.pvd")
    assert reader.time_values == [1.0, 5.0]
    reader.set_active_time_value(5.0)
    (mesh,) = reader.read()
    assert mesh.dimensions == (15, 11, 1)
    np.testing.assert_allclose(np.asarray(mesh["p"]).reshape(11, 15), plane.field("p", True), rtol=1e-12)
    plane.save(tmp_path / "one.pvd")
    assert pyvista.get_reader(tmp_path / "one.pvd").read()[0].n_points == 13 * 9


def test_sweep_in_pandas(cli: Any, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    done = cli("sweep", "problem1", "--n", 20, "--vary", "U=1,2,4", "--output", "speeds.csv")
    assert done.status == 0, done.err
    table = to_pandas(tmp_path / "speeds.csv")
    assert list(table["U"]) == [1, 2, 4] and table["converged"].all() and table["load"].dtype == float
    # mu U L^2/h^2 is the only scale, and the ends are at p = 0
    np.testing.assert_allclose(table["load"] / table["U"], table["load"][0], rtol=1e-6)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    for name, said in (("other.csv", "no csv of a sweep"), ("missing.csv", "No such file")):
        with pytest.raises(InputError, match=said):
            to_pandas(tmp_path / name)


def test_solutions_in_pandas(plane: Solution, line: Solution) -> None:
    pytest.importorskip("pandas")
    table = to_pandas([plane, line])
    assert list(table["load"]) == [plane.load, line.load] and list(table["nx"]) == [13, 21]
    assert table.attrs["units"]["p_max"] == "Pa" and table.attrs["units"]["flow_west"]
    assert math.isnan(table["flow_south"][1])


def surface() -> np.ndarray:
    """Heights (um) of a wave on 21 x 11 points over 1 x 0.5 mm."""
    x, y = np.linspace(0, 1, 21), np.linspace(0, 0.5, 11)
    return 10.0 + 2.0 * np.cos(2 * np.pi * x)[None, :] * np.cos(2 * np.pi * y)[:, None]


def loads(tmp_path: Path, *names: str) -> list[float]:
    found = []
    for name in names:
        with solve({**WAVE, "film": [{"shape": "profile", "file": str(tmp_path / name), "unit": "um"}]}) as solution:
            assert solution.converged
            found.append(solution.load)
    return found


def test_tif_profile_is_that_of_npy(tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    np.save(tmp_path / "h.npy", surface())
    tifffile.imwrite(tmp_path / "h.tif", surface().astype("f4"))
    tifffile.imwrite(tmp_path / "colours.tif", np.zeros((4, 4, 3), "u1"))
    (tmp_path / "broken.tif").write_bytes(b"II*\0 and no more")
    ours, theirs = loads(tmp_path, "h.npy", "h.tif")
    assert theirs == pytest.approx(ours, rel=1e-5)
    for name, said in (("colours.tif", "one channel"), ("broken.tif", "broken.tif"), ("none.tif", "No such file")):
        with pytest.raises(InputError, match=said):
            loads(tmp_path, name)


@pytest.mark.parametrize("suffix", [".sur", ".al3d"])
def test_metrology_profile_is_that_of_npy(suffix: str, tmp_path: Path) -> None:
    surfalize = pytest.importorskip("surfalize")
    np.save(tmp_path / "h.npy", surface())
    surfalize.Surface(surface(), 1000 / 20, 500 / 10).save(tmp_path / f"h{suffix}")  # steps in um
    ours, theirs = loads(tmp_path, "h.npy", f"h{suffix}")
    assert theirs == pytest.approx(ours, rel=1e-4)
    (tmp_path / f"broken{suffix}").write_bytes(b"no surface")
    with pytest.raises(InputError, match="cannot read"):
        loads(tmp_path, f"broken{suffix}")
    with pytest.raises(InputError, match="dimension = 2"):
        load_scene(
            {
                **WAVE,
                "dimension": 1,
                "width": None,
                "ny": None,
                "film": [{"shape": "profile", "file": str(tmp_path / f"h{suffix}")}],
            }
        ).build()


@pytest.mark.parametrize("name, library", [("h.tif", "tifffile"), ("h.x3p", "surfalize")])
def test_a_missing_library_is_named(name: str, library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=rf"{library}: pip install lcp-lube\[surface\]"):
        loads(tmp_path, name)
