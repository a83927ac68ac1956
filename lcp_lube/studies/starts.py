"""Stability of DIN against its starting vector: p0, r0 from 1e-15 to 1e3 by each rule for mu (the paper's table 5 as a map)."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..base.resumable import ResumableCsv
from ..output.console import say
from ..problems.solution import Outcome
from ..scenes.scene import load_scene
from .experiment import open_store, run
from .log import write_log
from .starts_picture import draw_lines, draw_maps, lines_sentence, map_sentence, rule

SCENES = ("problem1", "problem2", "problem3")
DECADES = range(-15, 4)  # p0 = r0 = 10^k; p0 in the problem's unit, MPa
GRID = range(-15, 4, 2)  # p0 x r0
N = 100  # the table's grid
LAPACK, SPARSE = "lu", "superlu"  # pivoting by rows in dense LU, which the table's rows were run with, and in SuperLU

# Rules for mu with the paper's step-length conditions; and the default one without centrality.
RULES = (("mu1", "FCB"), ("mu2", "FCB"), ("adaptive", "FCB"), ("mu2", "FB"))

KEY = ("scene", "n", "recipe", "mu", "conditions", "p0", "r0", "ranks")


def starts(quick: bool) -> Iterator[dict[str, Any]]:
    """Key columns of all runs: equal starts by both solvers, then the grid by LAPACK; quick: four by four on one scene."""
    scenes, decades, grid, n = (SCENES[:1], range(-15, 4, 6), range(-15, 4, 6), 20) if quick else (SCENES, DECADES, GRID, N)
    pairs = {
        LAPACK: [(k, k) for k in decades] + [(k, l) for k in grid for l in grid if k != l],
        SPARSE: [(k, k) for k in decades],
    }
    for scene in scenes:
        for recipe, exponents in pairs.items():
            for mu, conditions in RULES:
                fixed = {"scene": scene, "n": n, "recipe": recipe, "mu": mu, "conditions": conditions}
                yield from ({**fixed, "p0": f"1e{k}", "r0": f"1e{l}"} for k, l in exponents)


def chart(quick: bool = False, results: Path = Path("lcp_lube_results")) -> int:
    """Make the runs that are not in the csv yet, then draw both pictures from it. Collective.

    Parameters
    ----------
    quick : a map of few points on a small grid, kept apart from the full one.
    results : folder of starts.csv, starts_lines.png (p0 = r0) and starts_map.png (p0 x r0), or starts_quick...

    Returns
    -------
    int : exit status 0; a run that fails is a point of the map.

    Raises
    ------
    InputError : see `open_store`.
    """
    stem = "starts_quick" if quick else "starts"
    store = open_store(results / f"{stem}.csv", KEY, ())
    known = len(store.rows)
    wanted = list(starts(quick))
    rows = [_row(store, start) for start in wanted]
    say(f"{lines_sentence(rows)}\n{map_sentence(rows)}")
    pictures = [results / f"{stem}_{kind}.png" for kind in ("lines", "map")]
    if not quick:
        write_log(results, "stability: starts", rows, f"{lines_sentence(rows)} {map_sentence(rows)}", pictures)
    draw_lines(rows, results / f"{stem}_lines.png", store.comm)
    draw_maps(rows, results / f"{stem}_map.png", store.comm)
    say(
        f"{results / stem}_lines.png, {stem}_map.png: {len(rows)} runs, {len(store.rows) - known} of them new; the others "
        f"stood in {store.path} (remove it to run them again)."
    )
    return 0


def _row(store: ResumableCsv, start: dict[str, Any]) -> dict[str, str]:
    """The row of one start, from the csv or from a run. Collective."""
    key = {**start, "ranks": store.comm.size}
    row = store.find(**key)
    if row is not None:
        return row
    values = run(
        load_scene(start["scene"], {"n": start["n"]}),
        method="din",
        system="full",
        recipe=start["recipe"],
        options={name: start[name] for name in ("mu", "conditions")} | {name: float(start[name]) for name in ("p0", "r0")},
    )
    row = store.add({**values, **key})
    if row["outcome"] != Outcome.CONVERGED:
        say(f"{start['scene']} {start['recipe']} {rule(row)} p0 {start['p0']} r0 {start['r0']}: {row['message']}")
    return row
