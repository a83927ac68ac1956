"""What a whole solve sends between ranks, counted by Open MPI itself (hypre's messages too): messages, bytes, reductions.

    python benchmarks/communication.py [--results DIR]

Problem 4 by the nested active set on 2, 4 and 8 ranks, which may share cores: counts need no clock. Open MPI's pml_monitoring
component writes them, a file a rank; the largest rank's figures go to communication.csv, rows there are not run again.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

RANKS = (2, 4, 8)
SIZES = (250, 500, 1000)
KEY = ("scene", "n", "ranks")
COLUMNS = ["messages", "bytes", "collectives", "finest_linear", "iterations", "outcome"]
ENVIRONMENT = {
    **os.environ,
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
}
MONITORING = {"enable": "2", "enable_output": "3", "filename": ""}  # the last one is a run's own


def count(n: int, ranks: int) -> dict[str, object]:
    """The largest rank's messages and bytes sent, its collective calls, and the run's iterations.

    Raises
    ------
    RuntimeError : the job failed, or this MPI has no such component.
    """
    with tempfile.TemporaryDirectory() as folder:
        solver = [sys.executable, "-m", "lcp_lube", "solve", "problem4", "--n", str(n), "--method", "active-set", "--system"]
        choices = ["cavity", "--recipe", "bcgs_amg", "--nested", "--json"]
        values = {**MONITORING, "filename": f"{folder}/run"}
        monitoring = [word for name, value in values.items() for word in ("--mca", f"pml_monitoring_{name}", value)]
        command = ["mpiexec", "-n", str(ranks), *monitoring, *solver, *choices]
        done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT)
        texts = [path.read_text() for path in sorted(Path(folder).glob("run.*.prof"))]
    if done.returncode or len(texts) != ranks:
        raise RuntimeError(f"n = {n}, {ranks} ranks: exit status {done.returncode}, {len(texts)} files: {done.stderr[-200:]}")
    data = json.loads(done.stdout)
    sent = [re.findall(r"^E\t\d+\t\d+\t(\d+) bytes\t(\d+) msgs", text, re.MULTILINE) for text in texts]
    all_to_all = [re.findall(r"^A2A\t\d+\t\d+ bytes\t(\d+) msgs", text, re.MULTILINE) for text in texts]
    return {
        "messages": max(sum(int(messages) for _, messages in of_rank) for of_rank in sent),
        "bytes": max(sum(int(size) for size, _ in of_rank) for of_rank in sent),
        "collectives": max(sum(map(int, of_rank)) for of_rank in all_to_all),
        "finest_linear": data["linear_iterations"],
        "iterations": " ".join(str(level["iterations"]) for level in data["levels"]),
        "outcome": data["outcome"],
    }


def main() -> None:
    from lcp_lube.base.resumable import ResumableCsv

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    store = ResumableCsv(parser.parse_args().results / "communication.csv", [*KEY, *COLUMNS], KEY, signed=True)
    for n in SIZES:
        for ranks in RANKS:
            row = store.row({"scene": "problem4", "n": n, "ranks": ranks}, partial(count, n, ranks))
            print("  ".join(f"{name} {row[name]}" for name in (*KEY, *COLUMNS)), store.age(row), flush=True)


if __name__ == "__main__":
    main()
