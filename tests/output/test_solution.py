"""What a Python user gets: solve by name, path or dictionary, and the Solution."""

import copy
import gc
import json
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import marches
import numpy as np
import pytest
from petsc4py import PETSc

import lcp_lube
from lcp_lube import InputError, Solution, load_scene, solve
from lcp_lube.output.results import as_dict, summary
from lcp_lube.problems.film.contact import areas
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.registry import SCENE_DIR, scene_names


def test_the_package_shows_what_there_is() -> None:
    assert set(dir(lcp_lube)) == set(lcp_lube.__all__) >= {"Scene", "Solution", "load_scene", "solve"}


@pytest.mark.parametrize(
    "source",
    ["problem1", SCENE_DIR / "problem1.toml", load_scene("problem1"), {"family": "slider", "n": 100}],
    ids=["name", "path", "scene", "dictionary"],
)
def test_a_scene_is_named_in_any_way_and_changed_by_keywords(source: Any) -> None:
    solution = solve(source, n=30, h_min=1.2e-5, method="active-set")
    assert solution.converged and solution.problem.grid.shape == (30,)
    assert solution.problem.quantities(solution.fields)["min_h"] == pytest.approx(1.2e-5, rel=1e-2)
    solution.destroy()


def test_a_misspelt_argument_is_said_to_be_one() -> None:
    with pytest.raises(InputError, match="an Ask is allowed; a scene's keys are given by name"):
        solve("problem1", {"n": 200})
    with pytest.raises(InputError, match="metod is neither a key of the scene nor an argument; nearest is method"):
        solve("problem1", metod="din")


def small(name: str) -> Solution:
    lobes = {"nx": 60, "ny": 5} if name in ("three_lobe_journal", "tilting_pad_journal") else {"n": 24}  # they need whole pads
    return solve(name, **{**lobes, **marches.SMALL.get(name, {})})


@pytest.fixture(scope="module")
def answers() -> Iterator[Callable[[str], Solution]]:
    """`small` solutions for those that only read them: each is solved for once."""
    known: dict[str, Solution] = {}

    def answer(name: str) -> Solution:
        if name not in known:
            known[name] = small(name)
        return known[name]

    yield answer
    for solution in known.values():
        solution.destroy()


@pytest.fixture(scope="module")
def film() -> Iterator[Solution]:
    with solve("problem4", nx=20, ny=15) as solution:
        yield solution


def test_a_solution_in_one_line_and_by_names(film: Solution) -> None:
    assert repr(film) == summary(as_dict(film)).splitlines()[0] and "problem4 (20 x 15" in str(film)
    assert summary({**as_dict(film), "scene": "", "took_over": "din"}).startswith("film (20 x 15, ")
    assert ", from which din took over on the " in summary({**as_dict(film), "took_over": "din"})
    numbers = film.problem.quantities(film.fields)
    assert film.load == numbers["load"] == film.quantities["load"] and film.p_max == numbers["p_max"]
    assert (film.units["load"], film.units["p"], film.units["x"], film.units["r"]) == ("N", "Pa", "m", "")
    assert film.mass_defect == film.certificate.measures["mass_defect"] and film.ranks == 1
    assert {"load", "p", "x", "plot", "quantities"} <= set(dir(film)) and film.took_over is None
    assert film.method == film.quantities["method"]
    with pytest.raises(AttributeError, match="no lood; nearest is load"):
        film.lood  # noqa: B018
    with pytest.raises(InputError, match="no field q; there are p, r, h, x, y"):
        film.field("q")
    with pytest.raises(InputError, match=r"a\.xyz: extension"):
        film.plot("a.xyz")


def test_derivatives_of_a_solution(film: Solution) -> None:
    every = film.gradient()
    assert {"U", "mu", "h_offset"} <= set(every)
    assert film.gradient("load", "mu") == film.gradient(keys=["mu"]) == {"mu": every["mu"]}
    field = film.film_gradient("load")
    assert field.shape == film.p.shape
    assert field.ravel() @ areas(film.problem.grid).ravel() == pytest.approx(every["h_offset"], rel=1e-7)
    assert not np.array_equal(film.film_gradient("friction"), field)
    with pytest.raises(InputError, match="nearest is friction"):
        film.film_gradient("fricton")
    assert film.coefficients().K.shape == (1, 1)
    slow, fast = film.coefficients(frequency=[0.0, 1e4])
    assert slow.K[0, 0] == film.coefficients(0.0).K[0, 0] != fast.K[0, 0]
    with pytest.raises(InputError, match="numbers in rad/s are needed"):
        film.coefficients(frequency="fast")


@pytest.mark.parametrize(
    "given, message",
    [
        ({"accuracy": "a"}, "accuracy = 'a': a number is needed"),
        ({"method": 3}, "method = 3: a text is needed"),
        ({"stopping": {"eps": 1.0}}, "stopping.eps: unknown; nearest is eps2; there are eps1, eps2, max_it"),
        ({"start": 3}, "start = 3: a Solution is needed"),
        ({"finest": -3}, "finest = -3: a tuple is needed"),
    ],
)
def test_what_ask_may_be(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve("problem1", **given)


def test_fields_are_arrays_in_si(film: Solution) -> None:
    grid, problem = film.problem.grid, film.problem
    assert film.p.shape == film.r.shape == film.h.shape == film.x.shape == film.y.shape == (15, 20)
    np.testing.assert_array_equal(film.p.ravel(), film.fields["p"] * problem.p_unit + problem.p_c)
    at = np.unravel_index(np.argmax(film.p), film.p.shape)
    assert [film.x[at], film.y[at]] == film.p_max_at and film.p[at] == film.p_max
    assert film.x[0, 0] == grid.spacing[0] and film.y[0, 0] == grid.spacing[1]
    with solve("problem1", n=12) as line:
        assert line.p.shape == line.x.shape == (12,) and line.units["load"] == "N/m"
        assert line.field("x", boundary=True).tolist() == pytest.approx([*np.linspace(0, line.problem.grid.lengths[0], 14)])


@pytest.mark.parametrize("name", [name for name in scene_names() if name not in ("ehl_line", "obstacle_ball")])
def test_fields_with_the_points_of_the_sides(name: str, answers: Callable[[str], Solution]) -> None:
    solution = answers(name)
    for field, (values, _) in solution.problem.physical(solution.fields).items():
        inner = values.reshape(solution.problem.grid.box)
        whole = np.atleast_2d(solution.field(field, boundary=True))
        lines = slice(1, -1) if solution.problem.grid.dim == 2 else slice(None)
        assert whole.shape[1] == inner.shape[1] + 2 and np.all(np.isfinite(whole))
        np.testing.assert_array_equal(whole[lines, 1:-1], inner)
        if field == "p" and type(solution.problem) is LubricationProblem and solution.problem.grid.ends[0][0] == "open":
            assert np.all(whole[lines, 0] == solution.problem.p_sides[0] + solution.problem.p_c)
        if name in ("bratu", "obstacle_bratu") and field == "v":
            assert not whole[0].any() and not whole[:, -1].any()


def test_periodic_and_closed_sides_go_on() -> None:
    pad = {"family": "bearing", "dimension": 2, "L": 0.02, "width": 0.01, "U": 1.0, "nx": 9, "ny": 6, "fluid": {"mu": 0.01}}
    film = [{"shape": "linear", "h_start": 2e-5, "h_end": 1e-5}]
    sides = {"west": {"p": 2e5, "r": 0}, "south": "periodic", "north": "periodic", "east": "closed"}
    with solve({**pad, "film": film, "sides": sides}) as s:
        p, y = s.field("p", boundary=True), s.field("y", boundary=True)
        assert p.shape == (8, 11) and np.all(p[:, 0] == 2e5)
        np.testing.assert_array_equal(p[1:-1, -1], s.p[:, -1])  # closed: the last value
        np.testing.assert_allclose(p[0, 1:-1], 0.5 * (s.p[0] + s.p[-1]))
        assert y[0, 0] == 0 and y[-1, 0] == 0.01


def test_without_sides_there_is_no_boundary() -> None:
    with solve("ehl_line", n=20) as s, pytest.raises(InputError, match="no points on a boundary"):
        s.field("p", boundary=True)


@pytest.mark.parametrize("name", scene_names())
def test_every_number_has_a_unit(name: str, answers: Callable[[str], Solution]) -> None:
    """Numbers of a film that are not dimensionless have one; those of dimensionless problems have none."""
    s = answers(name)
    assert set(s.numbers) <= set(s.units)
    if isinstance(s.problem, LubricationProblem):
        numbers = {"cavitated_fraction", "friction_coefficient", "sommerfeld", "side_leakage_number", "eccentricity", "S"}
        assert {key for key in s.numbers if not s.units[key]} <= numbers


def test_saved_and_drawn(film: Solution, tmp_path: Path) -> None:
    film.save(tmp_path / "film.npz", boundary=True)
    with np.load(tmp_path / "film.npz") as data:
        assert data["p"].shape == (17, 22) and data["x"].shape == (22,) and data["h"][0, 0] == film.problem.film(0.0, 0.0)
        assert json.loads(str(data["units"])) == {"p": "Pa", "r": "", "h": "m", "x": "m", "y": "m"}
    film.plot(tmp_path / "film.png")
    assert (tmp_path / "film.png").stat().st_size > 1000


@pytest.mark.skipif(not PETSc.Sys.hasExternalPackage("hdf5"), reason="this PETSc has no HDF5")
def test_hdf5_carries_units(film: Solution, tmp_path: Path) -> None:
    film.save(tmp_path / "film.h5", boundary=True)
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "film.h5") as file:
        assert {name: data.attrs["units"].decode() for name, data in file.items()} == {
            name: film.units[name] for name in "prhxy"
        }
        np.testing.assert_array_equal(file["p"], film.field("p", boundary=True))
        result = json.loads(file.attrs["result"])
    assert result["load"] == film.load and result["scene_units"]["L"] == "m" and result["scene_data"]["family"] == "slider"


def test_as_a_dataset(film: Solution) -> None:
    pytest.importorskip("xarray")
    data = film.to_xarray()
    assert dict(data.sizes) == {"y": 15, "x": 20} and data.p.attrs["units"] == "Pa" and data.attrs["load"] == film.load
    np.testing.assert_array_equal(data.p, film.p)
    np.testing.assert_array_equal(data.x, film.x[0])
    assert film.to_xarray(boundary=True).h.shape == (17, 22)
    with solve("problem1", n=12) as line:
        assert line.to_xarray().p.dims == ("x",)


def same(one: Solution, other: Solution) -> None:
    assert repr(one) == repr(other) and one.quantities == other.quantities and one.units == other.units
    for name, values in one.fields.items():
        np.testing.assert_array_equal(other.fields[name], values)
    assert other.certificate == one.certificate and other.steps == one.steps
    for name in one.problem.physical(one.fields):
        np.testing.assert_array_equal(other.field(name), one.field(name))


@pytest.mark.parametrize("name", scene_names())
def test_pickled_and_copied(name: str, tmp_path: Path) -> None:
    """Fields, grid and record are kept, PETSc objects made anew: a copy is drawn, certified and started from."""
    solution = small(name)
    copies = [pickle.loads(pickle.dumps(solution)), copy.deepcopy(solution)]
    for made in copies:
        same(solution, made)
    solution.destroy()
    for made in copies:
        if name not in marches.SMALL:  # whose certificate is the worst of all steps
            assert made.problem.certify(made.fields, 1e-8).measures == pytest.approx(
                solution.certificate.measures, rel=1e-6, abs=1e-12
            )
        made.save(tmp_path / "copy.npz")
        made.destroy()
        made.destroy()


def test_the_record_outlives_everything_of_petsc() -> None:
    solution = solve("problem1", n=10)
    solution.destroy()
    assert solution.quantities["ranks"] >= 1 and solution.iterations > 0


def test_a_pickled_neighbour_is_a_start() -> None:
    near = pickle.loads(pickle.dumps(solve("problem4", n=40, method="active-set")))
    with solve("problem4", n=40, U=5.1, method="active-set", start=near) as warm, solve("problem4", n=40, U=5.1) as cold:
        assert warm.converged and warm.load == pytest.approx(cold.load, rel=1e-6)


def test_without_destroy_petsc_objects_go_with_the_solution() -> None:
    solution = solve("problem4", n=12, method="din")
    held = solution.problem.A
    assert held.refcount > 0
    del solution
    gc.collect()
    assert not held


@pytest.mark.parametrize("name", ["problem1", "problem4", "ring_journal", "ehl_line", "obstacle_ball", "bratu", "squeeze"])
def test_freed_solutions_still_answer(name, tmp_path):
    """PETSc's handles are gone after `with`: what needs one makes it again, and nothing ends the process."""
    few = {"n": 15, **marches.SMALL.get(name, {})}
    with solve(name, **few) as s:
        expected = s.quantities
    assert s.quantities == expected and repr(s) and dir(s)
    with pytest.raises(AttributeError, match="no such_thing"):
        s.such_thing  # noqa: B018
    s.save(tmp_path / "s.npz")
    s.save(tmp_path / "s.vts")
    s.plot(tmp_path / "s.png")
    assert np.isfinite(s.field("x")).all() and s.to_xarray() is not None
    if name != "squeeze":  # every step of which is certified by itself
        assert s.problem.certify(s.fields, 1e-8).holds
    again = pickle.loads(pickle.dumps(s))
    assert again.quantities["outcome"] == "converged"
    with solve(name, **few, start=s) as warm:
        assert warm.converged
