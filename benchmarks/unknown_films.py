"""`auto` on films that nobody tuned for (tests/wild_films.py), compared with a dense solver: 20,000 of them, in 1D and 2D.

Every film is a row of a csv; what is there already is not run again, so that a run may be stopped and taken up.

    python benchmarks/unknown_films.py [--films 20000] [--seed 0] [--minutes 5] [--output results/unknown_films.csv]
"""

import argparse
import csv
import sys
import tempfile
from collections import Counter
from pathlib import Path
from time import monotonic

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from wild_films import WRONG, judge

COLUMNS = ["seed", "what", "method", "error", "ratio", "message"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first film")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after so many")
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results" / "unknown_films.csv")
    args = parser.parse_args()
    rows = list(csv.DictReader(args.output.open(newline=""))) if args.output.exists() else []
    done, begin = {int(row["seed"]) for row in rows}, monotonic()
    with args.output.open("a", newline="") as file, tempfile.TemporaryDirectory() as folder:
        writer = csv.DictWriter(file, COLUMNS)
        if not rows:
            writer.writeheader()
        for seed in range(args.seed, args.seed + args.films):
            if seed in done:
                continue
            if monotonic() - begin > 60 * args.minutes:
                break
            v = judge(seed, Path(folder))
            told = "" if v.what == "converged" and v.good else v.message
            row: dict[str, str] = {
                "seed": str(seed),
                "what": v.what,
                "method": v.method,
                "error": f"{v.error:.1e}",
                "ratio": f"{v.ratio:.1e}",
            }
            writer.writerow({**row, "message": told})
            file.flush()
            rows.append({**row, "message": told})
            for path in Path(folder).glob("*.csv"):
                path.unlink()
    ended = Counter(row["what"] for row in rows)
    wrong = [row for row in rows if row["what"] == "converged" and not float(row["error"]) <= WRONG]
    print(f"{len(rows)} films: {dict(ended)}; wrong by more than {WRONG:g} of p_max: {len(wrong)}")
    open_ = [row for row in rows if row["what"] not in ("converged", "refused")]
    print(f"uncertified: {len(open_)}")
    for row in [*wrong, *open_]:
        print(", ".join(row[name] for name in COLUMNS))


if __name__ == "__main__":
    main()
