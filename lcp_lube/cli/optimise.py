"""`lcp-lube optimise`: the numbers of a scene that make one of its results largest or smallest."""

import argparse
import json
from dataclasses import replace
from typing import Any

from ..base.files import write_text
from ..base.options import check_unread
from ..base.progress import Line
from ..drivers.derivatives.gradient import check
from ..errors import InputError
from ..output.console import say
from ..output.results import finite
from ..output.table import table
from ..scenes.scene import Scene
from ..scenes.values import with_values
from ..scenes.written import toml_of
from ..studies.optimise import Limit, Range, Result, optimise, parse_limit, parse_range
from .asked import ask_of, scene_of


def run(args: argparse.Namespace) -> int:
    """Exit status 0 where the optimiser came to rest at a design that keeps the limits, else 1. Collective."""
    scene = scene_of(args)
    check(scene)
    if (args.maximise is None) == (args.minimise is None):
        raise InputError("optimise: --maximise Q or --minimise Q is needed, one of them")
    for path, suffix in ((args.output, ".toml"), (args.history, ".csv")):
        if path is not None and path.suffix.lower() != suffix:
            raise InputError(f"{path}: a name that ends in {suffix} is needed")
    goal, sign = (args.maximise, 1.0) if args.maximise is not None else (args.minimise, -1.0)
    ranges, limits = [parse_range(scene, text) for text in args.vary], [parse_limit(text) for text in args.subject]
    history = args.history or (args.output.with_suffix(".csv") if args.output else None)
    with Line() as line:
        ask = replace(ask_of(args), progress=line)
        found = optimise(scene, goal, sign, ranges, limits, ask=ask, history=history, most=args.steps)
    check_unread()
    if args.output is not None:
        write_text(args.output, toml_of(with_values(scene, found.best.values)))
    record = as_dict(scene, goal, sign, limits, found)
    say(json.dumps(finite(record)) if args.json else text_of(record, scene, ranges))
    return 0 if found.converged else 1


def as_dict(scene: Scene, goal: str, sign: float, limits: list[Limit], found: Result) -> dict[str, Any]:
    """The JSON's keys (docs/gradients.md)."""
    best = found.best
    return {
        "scene": scene.name,
        "goal": "maximise" if sign > 0 else "minimise",
        "quantity": goal,
        "start": {"values": found.start.values, "results": found.start.results},
        "best": {"values": best.values, "results": best.results, "gradient": best.slopes.get(goal, {})},
        "subject": [{"limit": str(one), "value": best.results.get(one.quantity)} for one in limits],
        "steps": found.steps,
        "designs": found.designs,
        "converged": found.converged,
        "message": found.message,
    }


def text_of(record: dict[str, Any], scene: Scene, ranges: list[Range]) -> str:
    """A table for people."""
    start, best, goal = record["start"], record["best"], record["quantity"]
    rows = [("", "start", "best", "")]
    for one in ranges:
        value = best["values"][one.key]
        width = 1e-6 * (one.high - one.low)
        at = "at its lower end" if value <= one.low + width else "at its upper end" if value >= one.high - width else ""
        rows.append((one.key, f"{start['values'][one.key]:.6g}", f"{value:.6g}", at))
    rows += [(name, f"{start['results'][name]:.6g}", f"{value:.6g}", "") for name, value in best["results"].items()]
    before, after = start["results"][goal], best["results"].get(goal, float("nan"))
    gain = f", {100 * (after - before) / abs(before):+.2f} %" if before else ""
    head = f"{scene.name}: {record['goal']} {goal}: {before:.6g} -> {after:.6g}{gain}"
    return "\n".join(
        [
            f"{head}; {record['designs']} designs, {record['message']}",
            *table(rows, align="<>><"),
            *(f"{one['limit']}: {one['value']:.6g}" for one in record["subject"]),
        ]
    )
