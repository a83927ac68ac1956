"""Every notebook of the site runs from its first cell to its last, as a program."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ENVIRONMENT

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.md"))


def cells(path: Path) -> list[str]:
    return re.findall(r"^```\{code-cell\} python\n(.*?)^```", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert path.read_text(encoding="utf-8").startswith("---\njupytext:") and len(cells(path)) >= 3
    program = "\n\n".join(cells(path))
    environment = {**ENVIRONMENT, "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


def test_there_are_some() -> None:
    assert len(NOTEBOOKS) >= 6
