"""The documentation as a whole: every page in the navigation, links, commands beside the theory; the site, built."""

import importlib.util
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import python
from test_readme import run, with_command

from lcp_lube.registry import METHODS

ROOT = Path(__file__).parents[2]
NAVIGATION = runpy.run_path(str(ROOT / "docs" / "site" / "navigation.py"))
SOURCES = [*sorted((ROOT / "docs").rglob("*.md")), *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"))]
# Pages of docs/guide, examples.md and notebooks have tests of their own.
PAGES = [ROOT / "docs" / "data.md", ROOT / "docs" / "coefficients.md", *sorted((ROOT / "docs" / "theory").glob("*.md"))]


def blocks(kind: str) -> list[tuple[str, str]]:
    pattern = rf"^```{kind}\n(.*?)^```"
    return [(p.name, block) for p in PAGES for block in re.findall(pattern, p.read_text(encoding="utf-8"), re.M | re.S)]


def test_every_page_has_its_place_once() -> None:
    places = [page for pages in NAVIGATION["sections"]().values() for page in pages]
    assert len(places) == len(set(places))
    there = {path.relative_to(ROOT).with_suffix("").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert there - {"docs/index"} <= set(places)
    for names in NAVIGATION["SECTIONS"].values():
        assert all(name.endswith("*") or (ROOT / f"{name}.md").is_file() for name in names)


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    return with_command(tmp_path, python())


@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_a_page_of_its_own(name: str) -> None:
    """With its equations; its name stands in the title, and the guide's table leads there."""
    titles = {path: path.read_text(encoding="utf-8").partition("\n")[0] for path in SOURCES}
    (page,) = (path for path, title in titles.items() if title.startswith("# ") and f"`{name}`" in title)
    assert re.findall(r"`(.*?)`", titles[page]) == [name]
    assert re.search(r"^(\$\$|    \w.*=)", page.read_text(encoding="utf-8"), re.M)
    guide = ROOT / "docs" / "guide" / "methods.md"
    (target,) = set(re.findall(rf"\[`{name}`\]\((.*?)\)", guide.read_text(encoding="utf-8")))
    assert (guide.parent / target).resolve() == page
    assert page.relative_to(ROOT).with_suffix("").as_posix() in NAVIGATION["sections"]()["Theory"]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path) -> None:
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        assert target.startswith("http") or (path.parent / target).exists(), target


@pytest.mark.parametrize("page, block", blocks("sh"))
def test_commands(page, block, tmp_path, environment) -> None:
    for line in block.splitlines():
        assert line.startswith("lcp-lube "), line
        done = run(["sh", "-c", line], tmp_path, environment)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page, block", blocks("python"))
def test_programs(page, block, tmp_path, environment) -> None:
    for library in ("xarray", "pandas"):
        if library in block or (library == "pandas" and "to_pandas" in block):
            pytest.importorskip(library)
    done = run([sys.executable, "-W", "error", "-c", block], tmp_path, environment)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


def test_the_api_page_has_every_public_name() -> None:
    import lcp_lube

    page = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    assert all(re.search(rf"lcp_lube\.{name}\b", page) for name in lcp_lube.__all__ if name != "__version__")


def test_links_of_a_built_site(tmp_path: Path) -> None:
    broken = runpy.run_path(str(ROOT / "tools" / "links.py"))["broken"]
    (tmp_path / "a.html").write_text('<a href="b.html#there">b</a><a href="https://else.where">e</a><h1 id="top">a</h1>')
    (tmp_path / "b.html").write_text('<h1 id="there">b</h1><a href="a.html#top">a</a>')
    assert broken(tmp_path) == []
    (tmp_path / "b.html").write_text('<h1 id="here">b</h1><img src="none.png"><a href="a.html#nowhere">a</a>')
    assert broken(tmp_path) == ["a.html: b.html#there", "b.html: a.html#nowhere", "b.html: none.png"]


def test_it_builds_without_a_warning(tmp_path: Path) -> None:
    """`make docs`, but for the notebooks, which test_notebooks.py runs."""
    for module in ("sphinx", "furo", "myst_nb", "sphinxarg", "sphinx_copybutton", "latex2mathml"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"no {module}: pip install lcp-lube[docs]")
    words = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-c", "docs", "-D", "nb_execution_mode=off"]
    words += ["-D", "suppress_warnings=myst.header,myst-nb.lexer"]  # a notebook's language is told by its kernel
    done = subprocess.run(
        [*words, "-d", str(tmp_path / "trees"), ".", str(tmp_path / "site")], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert runpy.run_path(str(ROOT / "tools" / "links.py"))["broken"](tmp_path / "site") == []
