"""What the scripts of the published tables share: `lcp-lube table K` with the runs kept beside them, in results/."""

import sys
from pathlib import Path

from lcp_lube.__main__ import main


def reproduce(paper: str, number: int) -> None:
    """Run and print a table, then leave with the command's exit status; the script's own arguments go with it.

    --quick leaves the long rows out; --stored runs nothing and prints what stands in results/ with its age.
    """
    results = Path(__file__).parent / "results"
    sys.exit(main(["table", str(number), "--paper", paper, "--results", str(results), *sys.argv[1:]]))
