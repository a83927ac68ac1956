"""The house: a file's folder says what it may touch, and imports go down only."""

import ast
from pathlib import Path

import pytest

import lcp_lube

PACKAGE = Path(lcp_lube.__file__).parent
# A layer may import those before it; files of the last two lie side by side.
LAYERS = ("base", "problems", "linear", "solvers", "scenes", "drivers", "api", "output", "cli studies")
EVERYONE = {"errors", "registry", ""}  # '' is the package itself: its version
RANK = {name: k for k, names in enumerate(LAYERS) for name in names.split()} | {"__main__": len(LAYERS)}


def layer(module: str) -> str:
    """The first word behind the package's name."""
    return module.partition(".")[2].partition(".")[0]


def imports(path: Path) -> set[str]:
    """Modules of this package that a file imports, at its top or inside functions."""
    package = ["lcp_lube", *path.relative_to(PACKAGE).parent.parts]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found |= {module} if node.module else {f"{module}.{name.name}" for name in node.names}
    return {name for name in found if name.partition(".")[0] == "lcp_lube"}


FILES = sorted(path for path in PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_down(path):
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if own == "__init__":
        return
    used = {layer(module) for module in imports(path)} - EVERYONE
    # A name of the package itself, such as its version, is no layer.
    used = {name for name in used if name in RANK}
    if own in EVERYONE:
        assert not used
    assert {name for name in used if RANK[name] > RANK.get(own, len(LAYERS))} == set()


def test_every_folder_has_its_layer():
    folders = {path.relative_to(PACKAGE).parts[0] for path in FILES if path.parent != PACKAGE}
    assert folders == set(" ".join(LAYERS).split()) - {"api"}
    assert {path.stem for path in PACKAGE.glob("*.py")} == {"__init__", "__main__", "api", "errors", "registry"}


def test_files_are_rooms():
    """No file is longer than one can keep in mind."""
    lengths = {str(path.relative_to(PACKAGE)): len(path.read_text().splitlines()) for path in FILES}
    lengths["registry.py"] -= 100  # a table: a line or two for each thing that has a name
    assert not {name: n for name, n in lengths.items() if n > 300}


def test_the_page_lists_the_drivers():
    """docs/architecture.md names them in their order."""
    from lcp_lube.registry import DRIVERS

    page = (PACKAGE.parent / "docs" / "architecture.md").read_text()
    assert ", ".join(f"`{name}`" for name in DRIVERS) in " ".join(page.split())
