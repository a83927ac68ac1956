"""Pictures show what was solved: no cavity where the film is full, no rounding in colour, true shapes, the instant they say."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import marches
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("matplotlib")
from drawn_text import overlapping
from matplotlib.axes import Axes
from matplotlib.text import Text

from lcp_lube.api import solve
from lcp_lube.output import maps, panels, picture
from lcp_lube.output.picture import Picture, title
from lcp_lube.output.plot import draw
from lcp_lube.registry import scene_names
from lcp_lube.scenes.scene import load_scene

MM = 1e-3


@contextmanager
def shown(source: Any, changes: dict[str, Any] | None = None, **choices: Any) -> Iterator[Picture]:
    """The picture of a scene's solution."""
    solution = solve(load_scene(source, changes or {}), **choices)
    found = picture.collect(solution)
    assert found is not None
    yield found
    solution.destroy()


@pytest.fixture
def bearing(tmp_path: Any) -> Callable[..., str]:
    """A scene file of a bearing from its first lines and its films."""

    def write(head: str, *films: str, p_supply: float = 1e5) -> str:
        path = tmp_path / "pad.toml"
        shapes = "".join(f"\n[[film]]\n{film}\n" for film in films)
        path.write_text(f'family = "bearing"\n{head}\n[fluid]\nmu = 0.02\np_supply = {p_supply}\n{shapes}')
        return str(path)

    return write


def bars(image: Any) -> tuple[float, float]:
    return image.get_clim()


def image_of(figure: Any, name: str) -> Any:
    """The image whose colour bar or title has this name."""
    for axes in figure.findobj(Axes):
        for image in (*axes.images, *axes.collections):
            bar = image.colorbar.ax if image.colorbar is not None else None
            if bar is not None and any(name in text for text in (bar.get_xlabel(), bar.get_ylabel(), axes.get_title())):
                return image
    raise AssertionError(name)


STEPS = ('constant"\nh_um = 20', 'step"\nheight_um = -8\nat_mm = {0}', 'pocket"\ndepth_um = 9\nx_mm = [{1}, {2}]')


@settings(max_examples=15, deadline=None)
@given(
    edges=st.tuples(st.floats(1, 48), st.floats(1, 24), st.floats(25, 49)),
    n=st.sampled_from([1, 2, 3, 7, 24]),
    scheme=st.sampled_from(["face", "nodal"]),
)
def test_a_full_film_is_drawn_full_wherever_its_edges_lie(
    edges: tuple[float, float, float], n: int, scheme: str, tmp_path_factory: Any
) -> None:
    path = tmp_path_factory.mktemp("full") / "pad.toml"
    films = "".join(f'[[film]]\nshape = "{film.format(*edges)}\n' for film in STEPS)
    head = f'family = "bearing"\nL_mm = 50\nU = 0.3\nn = {n}\nscheme = "{scheme}"\n[fluid]\nmu = 0.02\np_supply = 1e8\n'
    path.write_text(head + films)
    with shown(str(path)) as found:
        assert found.quantities["cavitated_fraction"] == 0.0
        fine = found.fine()
        _, r, thickness = panels.liquid_line(found, None, fine)
        assert np.abs(r).max() < 1e-9
        np.testing.assert_allclose(thickness, found.film(None, fine), rtol=1e-9)
        upper, _, right = draw(found).axes
        assert right.get_ylim() == (0.0, 1.0)
        assert not any(patch.get_label() == "cavity" for patch in upper.patches)


def test_a_full_film_with_dimples_in_the_plane_has_no_void(bearing: Any) -> None:
    dimples = 'shape = "dimples"\ndepth_um = 12\nsize_mm = 5.3\ncolumns = 5\nrows = 5\nform = "square"'
    scene = bearing("L_mm = 50\ndimension = 2\nU = 3\nnx = 37\nny = 19", 'shape = "constant"\nh_um = 10', dimples, p_supply=1e7)
    with shown(scene) as found:
        assert np.abs(found.void).max() < 1e-9
        figure = draw(found)
        assert bars(image_of(figure, "void")) == (0.0, 1.0)
        low, high = bars(image_of(figure, "pressure"))
        assert 8.0 < low < high < 12.0  # MPa


def test_the_liquid_in_a_cavity_is_as_thick_as_what_passes(bearing: Any) -> None:
    """Across a land's edges inside a cavity the liquid stays Q/U thick, whatever the gap does above it."""
    pocket = 'shape = "pocket"\ndepth_um = 7\nx_mm = [30.3, 40.9]'
    scene = bearing("L_mm = 50\nU = 3\nn = 24", 'shape = "linear"\nh_start_um = 10\nh_end_um = 20', pocket, p_supply=0.0)
    with shown(scene) as found:
        problem: Any = found.solution.problem
        Q = problem.boundary_flows(found.solution.fields["p"], found.solution.fields["r"])[0]
        x = found.fine()[100:-100]
        _, _, thickness = panels.liquid_line(found, None, x)
        np.testing.assert_allclose(thickness, Q / problem.U, rtol=1e-6)


@pytest.mark.parametrize("method", ["din", "fbn-a", "active-set"])
def test_a_void_that_is_rounding_is_not_drawn(method: str, bearing: Any) -> None:
    scene = bearing("L_mm = 50\nU = 1\nn = 15", 'shape = "constant"\nh_um = 10')
    with shown(scene, method=method) as found:
        assert found.sign.min() > 0.0
        assert found.limits("r") == (0.0, 1.0)
        assert found.limits("p") == pytest.approx((0.0, 1e5), rel=1e-6)


def test_a_void_of_1e_167_is_no_cavity(bearing: Any) -> None:
    scene = bearing("L_mm = 30\ndimension = 2\nU = 3\nn = 9", 'shape = "constant"\nh_um = 10', p_supply=0.0)
    solution = solve(load_scene(scene))
    solution.fields["p"][:] = 0.0
    solution.fields["r"][:] = 1e-167
    found = picture.collect(solution)
    assert found is not None
    assert found.sign.min() > 0.0
    assert "cavity" not in {text.get_text() for text in draw(found).findobj(Text)}
    solution.destroy()


def test_forces_that_are_rounding_have_one_colour() -> None:
    """obstacle_bratu touches neither obstacle: f is 1e-12 of nothing."""
    with shown("obstacle_bratu", {"n": 15}) as found:
        f = found.fields["f"][0]
        image = image_of(draw(found), "f")
        low, high = bars(image)
        assert np.ptp(f) < 1e-6 * (high - low)
        assert low == 0.0
    with shown("obstacle_ball", {"n": 15}) as found:
        f = found.fields["f"][0]
        assert bars(image_of(draw(found), "f")) == pytest.approx((f.min(), f.max()))


def test_the_end_of_a_squeeze_film_is_not_called_its_largest_pressure() -> None:
    with shown("squeeze", {"n": 19, "steps": 60}) as found:
        told = title(found)
        seen = found.quantities
        assert f"at the end, $t$ = {seen['t_end']:.4g}" in told
        assert f"was {seen['p_max']:.4g}" in told
        assert f"at $t$ = {seen['p_max_time']:.4g}" in told
        assert found.fields["p"][0].max() < 0.5 * seen["p_max"]
        figure = draw(found)
        assert [axes.get_ylim()[1] > axes.get_ylim()[0] for axes in figure.axes] == [True] * 3
        assert figure.axes[1].get_ylim()[1] >= 1.0  # no void: an axis of 0 to 1, not of +-0.05


@pytest.mark.parametrize(("L", "width"), [(100, 10), (10, 100), (30, 20), (20, 30), (50, 20), (20, 50), (1000, 10)])
def test_pads_keep_their_shape(L: float, width: float, bearing: Any) -> None:
    scene = bearing(
        f"L_mm = {L}\nwidth_mm = {width}\ndimension = 2\nU = 3\nnx = 12\nny = 9",
        'shape = "linear"\nh_start_um = 20\nh_end_um = 10',
    )
    with shown(scene) as found:
        figure = draw(found)
        figure.draw_without_rendering()
        axes = image_of(figure, "pressure").axes
        box = axes.get_window_extent()
        true = width / L
        drawn = box.height / box.width
        assert drawn == pytest.approx(np.clip(true, 1 / maps.SLENDER, maps.SLENDER), rel=0.01)
        assert min(box.height, box.width) > 0.3 * figure.dpi and max(box.height, box.width) > 2.0 * figure.dpi
        assert any("too long" in a.get_xlabel() for a in figure.findobj(Axes)) == (abs(drawn / true - 1) > 0.01)


@pytest.mark.parametrize("size", ["30\nwidth_mm = 20", "100\nwidth_mm = 10", "10\nwidth_mm = 100", "20\nwidth_mm = 40", "20"])
def test_labels_do_not_cover_one_another(size: str, bearing: Any) -> None:
    scene = bearing(f"L_mm = {size}\ndimension = 2\nU = 3\nnx = 9\nny = 7", 'shape = "parabola"\nh_min_um = 10\nh_max_um = 20')
    with shown(scene) as found:
        assert overlapping(draw(found)) == []


def test_near_fronts_are_named_side_by_side(bearing: Any) -> None:
    dimples = 'shape = "dimples"\ndepth_um = 12\nsize_mm = 5.3\ncolumns = 5\nform = "square"'
    with shown(bearing("L_mm = 50\nU = 5\nn = 60", 'shape = "constant"\nh_um = 10', dimples)) as found:
        assert len(found.fronts) == 2
        assert overlapping(draw(found)) == []


@pytest.mark.parametrize(
    "head",
    [
        'n = 31\nsides.east = "closed"',
        'n = 31\nsides.west = "closed"',
        'n = 31\ndimension = 2\nsides.west = "periodic"\nsides.east = "periodic"',
        'n = 15\ndimension = 2\nsides.west = "closed"\nsides.north = "closed"',
        "nx = 21\nny = 1\ndimension = 2",
        "nx = 1\nny = 21\ndimension = 2",
        "n = 1\ndimension = 2",
        "n = 1",
        "n = 2",
        "n = 3",
    ],
)
def test_what_is_drawn_lies_in_the_gap_and_in_the_picture(head: str, bearing: Any) -> None:
    with shown(bearing(f"L_mm = 30\nU = 3\n{head}", 'shape = "parabola"\nh_min_um = 10\nh_max_um = 20')) as found:
        x = found.fine()
        row = None if found.y.size == 0 else found.middle
        _, r, thickness = panels.liquid_line(found, row, x)
        assert ((r > -1e-6) & (r < 1.0 + 1e-6)).all()
        assert (thickness <= found.film(row, x) * (1.0 + 1e-6)).all()
        assert (thickness >= -1e-12).all()
        for axes in draw(found).findobj(Axes):
            for line in axes.lines:
                if line.get_label() in ("pressure p", "void fraction r", "exact"):
                    low, high = axes.get_ylim()
                    values = np.asarray(line.get_ydata(), dtype=float)
                    assert low - 0.06 * (high - low) <= values.min() and values.max() <= high


SMALL = {
    "journal": {"nx": 31, "ny": 9},
    "pocketed_pad_2d": {"nx": 19, "ny": 9},
    "rough": {"n": 15},
    "three_lobe_journal": {"nx": 90, "ny": 9},
    "tilting_pad_journal": {"nx": 90, "ny": 9},
    "squeeze": {"n": 9, "steps": 20},
    "moving_texture": {"n": 15, **marches.SMALL["moving_texture"]},
    "dynamic_journal": marches.SMALL["dynamic_journal"],
}


@pytest.mark.parametrize("name", scene_names())
def test_every_built_in_scene_is_drawn_with_labels_that_can_be_read(name: str) -> None:
    with shown(
        name, SMALL.get(name, {"nx": 31, "ny": 9} if name.endswith("_journal") and "long" not in name else {"n": 15})
    ) as found:
        assert overlapping(draw(found)) == []
