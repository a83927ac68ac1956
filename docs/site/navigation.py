"""The site's navigation: sections of pages in their order, and under 'More' every page of docs/ that none of them names."""

from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
MARK = "<!-- navigation -->"  # in docs/index.md
SECTIONS: dict[str, list[str]] = {
    "Tutorial": ["docs/install", "docs/guide/first_steps", "docs/notebooks/*"],
    "How-to": [
        "docs/guide/README",
        "docs/guide/tour",
        "docs/examples",
        "docs/explore",
        "docs/scene_files",
        "docs/data",
        "docs/coefficients",
        "docs/motion",
        "docs/gradients",
        "docs/guide/recipes",
        "docs/guide/parallel",
        "docs/guide/python",
        "docs/guide/troubleshooting",
    ],
    "Theory": [
        "docs/guide/methods",
        "docs/theory/problem",
        "docs/fast_path",
        "docs/nonlinear_multigrid",
        "docs/theory/*",
        "docs/guaranteed_bounds",
        "docs/accuracy",
        "docs/model",
        "docs/extrapolation",
    ],
    "Reference": [
        "docs/reference/commands",
        "docs/guide/scenes",
        "docs/reference/api",
        "docs/numbers",
        "docs/guide/words",
        "docs/guide/versions",
    ],
    "Measured": ["docs/results", "benchmarks/README", "benchmarks/results/CHARTS", "docs/comparison", "docs/processors"],
    "Project": ["CONTRIBUTING", "docs/architecture", "docs/stability", "CHANGELOG"],
}


def sections() -> dict[str, list[str]]:
    """Pages by section; a * takes those of a folder in the order of their names. Pages that are not there are left out."""
    pages = sorted(path.relative_to(ROOT).with_suffix("").as_posix() for path in (ROOT / "docs").rglob("*.md"))
    pages = [page for page in pages if not page.startswith("docs/site/") and page != "docs/index"]
    named = {name for names in SECTIONS.values() for name in names}
    found: dict[str, list[str]] = {}
    for title, names in SECTIONS.items():
        found[title] = []
        for name in names:
            star = (
                [page for page in pages if page.startswith(name[:-1]) and page not in named] if name.endswith("*") else [name]
            )
            found[title] += [page for page in star if (ROOT / f"{page}.md").is_file()]
    placed = {page for names in found.values() for page in names}
    return {**found, "More": [page for page in pages if page not in placed]}


def write(app: Any, name: str, source: list[str]) -> None:
    """Put the navigation in the place of its mark."""
    if MARK in source[0]:
        trees = [
            "\n".join(
                ["```{toctree}", f":caption: {title}", ":hidden:", ":maxdepth: 1", *(f"/{page}" for page in names), "```"]
            )
            for title, names in sections().items()
            if names
        ]
        source[0] = source[0].replace(MARK, "\n\n".join(trees))


def setup(app: Any) -> dict[str, bool]:
    app.connect("source-read", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
