"""Every notebook of the site runs from its first cell to its last, as a program."""

import re
from pathlib import Path

import pytest
from conftest import start

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.md"))


def cells(path: Path) -> list[str]:
    return re.findall(r"^```\{code-cell\} python\n(.*?)^```", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert path.read_text(encoding="utf-8").startswith("---\njupytext:") and len(cells(path)) >= 3
    program = "\n\n".join(["import matplotlib\n\nmatplotlib.use('Agg')", *cells(path)])
    done = start(["-c", program], 1, tmp_path, timeout=240)
    assert done.status == 0, f"{done.out}\n{done.err}"


def test_there_are_some() -> None:
    assert len(NOTEBOOKS) >= 6
