"""Starting vectors by rule for mu as a map, where table 5 has six points: runs and pictures in results/."""

import sys
from pathlib import Path

from lcp_lube.__main__ import main

if __name__ == "__main__":
    sys.exit(main(["chart", "stability", "starts", "--results", str(Path(__file__).parent / "results"), *sys.argv[1:]]))
