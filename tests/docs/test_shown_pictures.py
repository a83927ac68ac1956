"""Pictures in the documentation: none is stale, none is forgotten, each is small, and told apart without colour."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = runpy.run_path(str(ROOT / "tools" / "pictures.py"))
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    ROOT / "benchmarks/README.md",
    ROOT / "benchmarks/results/CHARTS.md",
]
COLUMN = 700  # pixels: the width of the site's text; a picture that is narrower would be blown up


def shown() -> set[Path]:
    found = set()
    for page in PAGES:
        found |= {
            (page.parent / name).resolve()
            for name in re.findall(r"(?:!\[[^\]]*\]\(|<img src=\")([^)\"]+\.png)", page.read_text(encoding="utf-8"))
        }
    return found


@pytest.mark.parametrize("name", SCRIPT["GROUPS"])
def test_no_picture_is_stale(name: str) -> None:
    """What it is drawn from is what `make pictures` saw; after a change: make pictures."""
    group = SCRIPT["GROUPS"][name]
    assert list(ROOT.glob(group.pictures)), group.pictures
    assert SCRIPT["stored"]().get(name) == group.digest(), f"make pictures (group {name})"


def test_every_picture_is_drawn_by_the_one_command() -> None:
    drawn = {path.resolve() for group in SCRIPT["GROUPS"].values() for path in ROOT.glob(group.pictures)}
    assert shown() <= drawn
    assert all(path.is_file() for path in shown())
    assert {path.resolve() for folder in ("pictures", "images") for path in (ROOT / "docs" / folder).iterdir()} <= shown()


def test_a_change_is_noticed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    group = SCRIPT["GROUPS"]["scaling"]
    other = type(group)([*group.command, "--quick"], group.pictures, group.inputs)
    assert other.digest() != group.digest()
    fewer = type(group)(group.command, group.pictures, group.inputs[1:])
    assert fewer.digest() != group.digest()


def test_they_are_wide_enough_and_small() -> None:
    image = pytest.importorskip("PIL.Image")
    for path in shown():
        with image.open(path) as picture:
            assert picture.width >= COLUMN, path
        assert path.stat().st_size < 650_000, path


def test_lines_are_told_apart_in_grey_and_by_all_eyes() -> None:
    """Colours that share a picture differ in lightness; maps get lighter, or darker, all the way."""
    mpl = pytest.importorskip("matplotlib")
    import numpy as np

    from lcp_lube.output.style import BLUE, MAPS, RED

    def grey(colour: object) -> float:
        return float(np.dot(mpl.colors.to_rgb(colour), (0.299, 0.587, 0.114)))

    assert abs(grey(BLUE) - grey(RED)) > 0.1
    for name in MAPS.values():
        steps = np.diff([grey(colour) for colour in mpl.colormaps[name](np.linspace(0, 1, 30))])
        assert (steps > 0).all() or (steps < 0).all(), name
