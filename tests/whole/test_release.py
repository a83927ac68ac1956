"""What a release is made of: one version, every folder and data file in the wheel, a recipe that renders, a paper."""

import re
import tomllib
from pathlib import Path

import pytest

import lcp_lube

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_version_has_one_place() -> None:
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "lcp_lube.__version__"}
    citation = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.M)
    recipe = re.search(r'default="([^"]+)"', (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    assert citation and recipe and {citation[1], recipe[1]} == {lcp_lube.__version__}
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {lcp_lube.__version__}" in changes


def test_the_wheel_has_every_folder_and_its_data() -> None:
    package = ROOT / "lcp_lube"
    setuptools = PROJECT["tool"]["setuptools"]
    folders = {".".join(path.parent.relative_to(ROOT).parts) for path in package.rglob("__init__.py")}
    assert folders | {"lcp_lube.options", "lcp_lube.published"} == set(setuptools["packages"])
    data = {name: [*patterns] for name, patterns in setuptools["package-data"].items()}
    for path in package.rglob("*"):
        if path.is_file() and path.suffix not in (".py", ".pyc", ".nbi", ".nbc") and "__pycache__" not in path.parts:
            folder = ".".join(path.parent.relative_to(ROOT).parts)
            assert any(path.match(pattern) for pattern in data.get(folder, [])), path


def test_the_conda_recipe_asks_for_what_the_project_asks_for() -> None:
    yaml = pytest.importorskip("yaml")
    recipe = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    needed = {re.split(r"[ ><=]", word)[0] for word in recipe["requirements"]["run"]} - {"python"}
    assert needed == {re.split(r"[ ><=]", word)[0] for word in PROJECT["project"]["dependencies"]}
    assert recipe["build"]["python"]["entry_points"] == [f"lcp-lube = {PROJECT['project']['scripts']['lcp-lube']}"]


def test_the_conda_recipe_renders() -> None:
    rattler_build = pytest.importorskip("rattler_build")
    recipe = rattler_build.Stage0Recipe.from_file(ROOT / "packaging" / "conda" / "recipe.yaml")
    (variant,) = recipe.render(rattler_build.VariantConfig(), rattler_build.RenderConfig())
    found = variant.recipe() if callable(variant.recipe) else variant.recipe
    assert found.to_dict()["package"] == {"name": "lcp-lube", "version": lcp_lube.__version__}


def test_the_paper_cites_what_its_list_has() -> None:
    paper = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    entries = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), re.M))
    assert set(re.findall(r"@(\w+)", paper)) == entries
    for head in ("Summary", "Statement of need", "State of the field", "References"):
        assert f"\n# {head}\n" in paper
    assert 400 <= len(paper.split()) <= 1200  # the journal's limits


def test_extras_are_documented() -> None:
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.M)) == set(PROJECT["project"]["optional-dependencies"]) - {"dist"}
