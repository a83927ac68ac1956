"""docs/examples.md: every command runs, prints the figures that stand there, and draws the picture that is shown.

`make pictures` draws the pictures of docs/pictures anew.
"""

import csv
import re
import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "examples.md").read_text(encoding="utf-8")
NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
MOST_BYTES = 100_000


@dataclass(frozen=True)
class Example:
    """A command, the files that stand before it and the lines that it is said to print."""

    command: str
    files: dict[str, str]
    lines: list[str]


def examples() -> list[Example]:
    """In their order; a TOML block is the file that the words before it name."""
    files: dict[str, str] = {}
    found: list[Example] = []
    parts = re.split(r"^```(\w*)\n", TEXT, flags=re.MULTILINE)  # prose, kind, block, "", prose, kind, ...
    for before, kind, block in zip(parts[::4], parts[1::4], parts[2::4], strict=False):
        if kind == "toml":
            files[re.findall(r"`(\w+\.toml)`", before)[-1]] = block
        elif kind == "sh":
            found += [Example(line, dict(files), []) for line in block.splitlines()]
        elif kind == "text":
            found[-1].lines.extend(block.splitlines())
    return found


def run(example: Example, folder: Path) -> subprocess.CompletedProcess[str]:
    from conftest import ENVIRONMENT, python

    for name, content in example.files.items():
        (folder / name).write_text(content, encoding="utf-8")
    words = [*python(), "-m", "lcp_lube", *shlex.split(example.command)[1:]]
    return subprocess.run(words, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=240, check=False)


def target(example: Example, option: str) -> str | None:
    match = re.search(rf"{option} (\S+)", example.command)
    return match[1] if match else None


def test_scenes_with_their_pictures() -> None:
    """Each picture shown is one that a command here draws, and there are none in the folder that no page shows."""
    picture = r"!\[.+?\]\(pictures/(\S+?)\)"
    shown = re.findall(picture, TEXT)
    assert len(shown) == len(set(shown)) >= 18
    assert sorted(shown) == sorted(filter(None, (target(example, "--plot") for example in examples())))
    pages = {name for page in DOCS.glob("*.md") for name in re.findall(picture, page.read_text(encoding="utf-8"))}
    assert pages == {path.name for path in (DOCS / "pictures").iterdir()}
    for name in shown:
        assert (DOCS / "pictures" / name).stat().st_size <= MOST_BYTES


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.command)
def test_commands(example: Example, tmp_path: Path) -> None:
    assert example.command.startswith("lcp-lube ")
    done = run(example, tmp_path)
    assert done.returncode == 0, done.stderr
    for line in example.lines:
        words = re.split(NUMBER, line)
        pattern = f"({NUMBER})".join(map(re.escape, words))
        match = re.search(pattern, done.stdout)
        assert match, f"{line!r} is not in\n{done.stdout}"
        for ours, printed in zip(match.groups(), re.findall(NUMBER, line), strict=True):
            assert float(ours) == pytest.approx(float(printed), rel=2e-3)
    if picture := target(example, "--plot"):
        image = pytest.importorskip("PIL.Image")
        with image.open(tmp_path / picture) as ours, image.open(DOCS / "pictures" / picture) as shown:
            assert ours.size == shown.size
    if table := target(example, "--output"):
        with (tmp_path / table).open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) > 3 and {row["outcome"] for row in rows} == {"converged"}


def renew() -> None:
    """Draw the pictures anew."""
    for example in examples():
        if picture := target(example, "--plot"):
            with tempfile.TemporaryDirectory() as folder:
                done = run(example, Path(folder))
                print(example.command, done.stdout, done.stderr, sep="\n")
                shutil.copy(Path(folder) / picture, DOCS / "pictures" / picture)


if __name__ == "__main__":
    renew()
