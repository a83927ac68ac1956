"""Peak memory of runs against the estimate made before them, and the constants of lcp_lube/drivers/memory.py that fit.

python benchmarks/memory.py [WORD]     only cases whose name contains WORD; each run is a process of its own
"""

import json
import os
import shutil
import subprocess
import sys

import numpy as np

# Name, command line, numbers of points a side, ranks.
CASES: list[tuple[str, str, tuple[int, ...], int]] = [
    ("1D reduced banded", "problem1 --method active-set", (50_000, 200_000, 400_000), 1),
    ("1D reduced banded interior", "problem1 --method din --system reduced --max-it 4", (50_000, 200_000), 1),
    ("1D full superlu", "problem1 --method din --max-it 4", (50_000, 200_000), 1),
    ("1D full umfpack", "problem1 --method din --recipe umfpack --max-it 3", (50_000, 200_000), 1),
    ("1D full klu", "problem1 --method din --recipe klu --max-it 3", (50_000, 200_000), 1),
    ("1D full mumps", "problem1 --method din --recipe mumps --max-it 3", (50_000, 200_000), 1),
    ("1D full light", "problem1 --method din --recipe bcgs_ilu --max-it 3", (50_000, 200_000), 1),
    ("1D full light gmres", "problem1 --method din --recipe gmres_ilu --max-it 3", (50_000, 200_000), 1),
    ("1D reduced mumps", "problem1 --method active-set", (100_000,), 2),
    ("2D fas", "problem4 --method fas", (300, 600, 1000), 1),
    ("2D cavity multigrid", "problem4 --method active-set", (300, 500, 700), 1),
    ("2D reduced multigrid", "problem4 --method din-pc --max-it 4", (200, 400), 1),
    ("2D reduced umfpack", "problem4 --method active-set --no-nested --system reduced --recipe umfpack", (100, 200, 300), 1),
    ("2D reduced superlu", "problem4 --method active-set --no-nested --system reduced --recipe superlu", (100, 200), 1),
    ("2D reduced mumps", "problem4 --method active-set --no-nested --system reduced --recipe mumps", (100, 200, 300), 1),
    ("2D full umfpack", "problem4 --method din --max-it 3", (100, 200, 300), 1),
    ("2D full superlu", "problem4 --method din --recipe superlu --max-it 3", (100, 200), 1),
    ("2D full mumps", "problem4 --method din --recipe mumps --max-it 2", (100, 200, 300), 1),
    ("2D full light", "problem4 --method din --recipe bcgs_ilu --max-it 2", (200, 300), 1),
    ("2D full light gmres", "problem4 --method din --recipe gmres_ilu --max-it 2", (200, 300), 1),
    ("2D fas in time", "piston_skirt --set motion.t_end=0.02 --set motion.steps=6", (300, 600, 1000), 1),
    ("2D fas, a free journal", "dynamic_journal --method fas --set motion.t_end=6e-4 --set motion.steps=3", (300, 600), 1),
    ("2D fas on 2 ranks", "problem4 --method fas", (300, 700), 2),
    ("2D cavity multigrid on 2 ranks", "problem4 --method active-set", (300, 500), 2),
    ("2D full mumps on 2 ranks", "problem4 --method din --max-it 2", (100, 200), 2),
    ("box multigrid", "obstacle_bratu", (200, 400, 700), 1),
    ("box umfpack", "obstacle_bratu", (40, 65), 1),
    ("equations multigrid", "bratu", (200, 400, 700), 1),
    ("equations umfpack", "bratu", (80, 130), 1),
    ("1D full dense LU", "problem1 --method din --recipe lu --max-it 2", (500, 1000, 1500), 1),
    ("dense", "ehl_line", (500, 1000, 2000), 1),
]


def measure(words: str, n: int, ranks: int) -> dict[str, float]:
    """The JSON of one run in its own process (of an MPI job, of its rank 0)."""
    command = [sys.executable, "-m", "lcp_lube", "solve", *words.split(), "--n", str(n), "--json"]
    if ranks > 1:
        command = [shutil.which("mpiexec") or "mpiexec", "-n", str(ranks), *command]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
    if not done.stdout.startswith("{"):
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-500:]}")
    return json.loads(done.stdout)


def main(word: str) -> None:
    for name, words, sizes, ranks in CASES:
        if word not in name:
            continue
        points, bytes_a_point = [], []
        for n in sizes:
            data = measure(words, n, ranks)
            count = int(data["nx"] * (data["ny"] or 1))
            estimate, peak = data["memory_estimate_mb"] or np.nan, data["memory_mb"]
            points.append(count)
            bytes_a_point.append((peak - (data["memory_base_mb"] or np.nan)) * 2**20 / count)
            print(
                f"{name:<32} {count:>9} points, {ranks} ranks: peak {peak:7.1f} MB, estimate {estimate:7.1f} "
                f"({100 * (estimate / peak - 1):+.0f} %), {bytes_a_point[-1]:6.0f} bytes a point",
                flush=True,
            )
        if len(sizes) > 1:
            b, a = np.polyfit(np.log2(points), bytes_a_point, 1)
            print(f"{'':<32} fit: {a:.0f} + {b:.0f} log2(points)", flush=True)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")
