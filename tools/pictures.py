"""The pictures of README.md and docs/, drawn anew by the commands that stand beside them: `make pictures`.

tools/pictures.digest holds a digest of what they are drawn from; tests/docs/test_examples.py finds one that is stale.
"""

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
DRAWING = ("journal", "liquid", "maps", "panels", "picture", "plot", "style", "units")  # files of lcp_lube/output
STORED = ROOT / "tools" / "pictures.digest"
FIRST = "lcp-lube solve problem4 --n 100 --plot problem4.png"  # README.md's picture


def digest() -> str:
    """Of the code that draws, and of the commands and scene files of docs/examples.md and README.md's picture."""
    blocks = re.findall(r"^```(?:sh|toml)\n(.*?)^```", (ROOT / "docs/examples.md").read_text(encoding="utf-8"), re.M | re.S)
    code = [(ROOT / "lcp_lube/output" / f"{name}.py").read_text(encoding="utf-8") for name in DRAWING]
    return hashlib.sha256("\0".join([FIRST, *blocks, *code]).encode()).hexdigest()


def main() -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, str(ROOT / "tests/docs/test_examples.py")], check=True, env=environment)
    words = FIRST.split()[1:-1]
    target = str(ROOT / "benchmarks/results/problem4.png")
    subprocess.run([sys.executable, "-m", "lcp_lube", *words, target], check=True, env=environment)
    STORED.write_text(digest() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
