"""`lcp-lube sensitivity`: which number of a scene matters how much, and where the film does."""

import argparse
import json
from dataclasses import replace
from functools import partial
from typing import Any

from ..api import solve
from ..base.options import check_unread
from ..base.progress import Line
from ..drivers.ask import Ask
from ..drivers.derivatives.goal_error import finer_shape, goal_error
from ..drivers.derivatives.gradient import Gradient, check, film_fields, gradients
from ..drivers.marches.march_course import Trace
from ..errors import InputError
from ..output import files, sensitivity
from ..output.console import say
from ..output.results import as_dict, finite
from ..problems.solution import Solution
from ..scenes.moving import motion_of
from ..scenes.scene import Scene
from ..scenes.values import key_of, values_of
from ..studies.error_bars import deviations, first_order, monte_carlo
from .asked import ask_of, scene_of

HEAD = ("scene", "nx", "ny", "outcome", "converged", "message")


def run(args: argparse.Namespace) -> int:
    """Exit status 0 if the film's solution converged, else 1. Collective."""
    scene = scene_of(args)
    check(scene)
    names = [name.strip() for name in args.quantity.split(",")]
    keys = [word.strip() for word in args.by.split(",")] if args.by else None
    for key in keys or []:
        if key != "balance.load":
            key_of(scene, key)
    for path, plot in ((args.plot, True), (args.output, False), (args.errors, True)):
        if path:
            files.check_target(path, plot)
    deviation = deviations(scene, {**(scene.tolerance or {}), **dict(map(_assignment, args.tolerance))})
    if args.monte_carlo is not None and not deviation:
        raise InputError(f"--monte-carlo {args.monte_carlo}: --tolerance KEY=U is needed too")
    keys = [*keys, *(key for key in deviation if key not in map(partial(key_of, scene), keys))] if keys else keys
    trace = Trace() if motion_of(scene) is not None else None
    if trace is not None and args.errors:
        raise InputError(f"--errors: scene {scene.name} goes on in time, and where errors come from is known of one film")
    with Line() as line, solve(scene, ask := replace(ask_of(args), progress=line), watch=trace) as solution:
        check_unread()
        data = as_dict(solution)
        record: dict[str, Any] = {key: data.get(key) for key in HEAD}
        if args.errors:
            finer_shape(solution)  # refused before the work that it costs
        if solution.converged:
            line("sweep", "derivatives", 0.5)
            found = gradients(scene, solution, names, keys, trace)
            record |= sensitivity.as_dict(found[0], solution)
            if found[1:]:
                record["others"] = [sensitivity.as_dict(one, solution) for one in found[1:]]
            bars = error_bars(args, scene, solution, found, deviation, ask)
            for one, into in zip(found, [record, *record.get("others", [])], strict=True):
                into |= {"error_bar": bars[one.quantity]} if bars else {}
            pictures(args, scene, solution, found, trace)
            if args.errors:
                record["grid_error"] = grid_error(args, scene, solution, names[0], ask)
        if args.json:
            say(json.dumps(finite(record)))
        else:
            say(text(record, solution, found if solution.converged else []))
            if solution.converged and bars:
                say("\n".join(bar_line(name, bar, sensitivity.unit_of(solution, name)) for name, bar in bars.items()))
            if told := record.get("grid_error"):
                shares = f"{told['cells']:.2g} of it from the cells, half of their sizes from {told['worst']:.1%} of them"
                say(f"grid: {told['finer']:.6g} at half the spacing, error near {told['error']:.2g}; {shares}")
    return 0 if solution.converged else 1


def _assignment(text: str) -> tuple[str, str]:
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise InputError(f"--tolerance {text}: KEY=U is needed")
    return key, value


def error_bars(
    args: argparse.Namespace, scene: Scene, solution: Solution, found: list[Gradient], deviation: dict[str, float], ask: Ask
) -> dict[str, dict[str, Any]]:
    """By quantity: standard deviation to first order, its parts, and what samples gave. Collective."""
    bars: dict[str, dict[str, Any]] = {}
    for one in found if deviation else ():
        size, parts = first_order(one, deviation)
        bars[one.quantity] = {"value": one.value, "deviation": size, "parts": parts}
    if bars and args.monte_carlo is not None:
        samples = monte_carlo(scene, solution, [*bars], deviation, args.monte_carlo, args.seed, ask)
        counts = {"relative_error": samples.error, "samples": samples.solved, "failed": samples.failed, "seed": args.seed}
        for name, bar in bars.items():
            bar["monte_carlo"] = {"mean": samples.mean[name], "deviation": samples.deviation[name], **counts}
    return bars


def grid_error(args: argparse.Namespace, scene: Scene, solution: Solution, quantity: str, ask: Ask) -> dict[str, float]:
    """What the grid costs a number, drawn where it comes from; one more solve, at half the spacing. Collective."""
    with solve(scene.with_shape(finer_shape(solution)), ask, start=solution) as finer:
        found = goal_error(scene, solution, finer, quantity)
    sensitivity.plot_error(found, solution, args.errors)
    return {name: getattr(found, name) for name in ("value", "finer", "error", "cells", "worst")}


def bar_line(name: str, bar: dict[str, Any], unit: str) -> str:
    """First order beside the samples."""
    parts = ", ".join(f"{key} {part:.3g}" for key, part in sorted(bar["parts"].items(), key=lambda item: -item[1]))
    lines = [f"{name} = {bar['value']:.6g} +- {bar['deviation']:.3g} {unit}, to first order ({parts})"]
    if samples := bar.get("monte_carlo"):
        lines.append(
            f"{name} = {samples['mean']:.6g} +- {samples['deviation']:.3g} {unit}, of {samples['samples']} samples"
            f" (seed {samples['seed']}, {samples['failed']} failed; +- {samples['relative_error']:.1%} of the deviation)"
        )
    return "\n".join(lines)


def pictures(args: argparse.Namespace, scene: Scene, solution: Solution, found: list[Gradient], trace: Trace | None) -> None:
    """The film's derivative, drawn and written where that was asked for. Collective."""
    if not (args.plot or args.output):
        return
    names = [one.quantity for one in found]
    fields = film_fields(scene, solution, names if args.output else names[:1], trace)
    if args.plot:
        sensitivity.plot(found[0], solution, fields[names[0]], args.plot)
    if args.output:
        dim = solution.problem.grid.dim
        # Of d(Q)/dh per area (1D: per length).
        units = {name: f"{sensitivity.unit_of(solution, name) or '1'}/m{dim + 1}" for name in names}
        more = {f"d{name}_dh": (fields[name], units[name]) for name in names}
        files.save(solution, args.output, more=more)


def text(record: dict[str, Any], solution: Solution, found: list[Gradient]) -> str:
    """Tables for people."""
    shape = " x ".join(str(record[side]) for side in ("nx", "ny") if record[side])
    if not found:
        return f"{record['scene']} ({shape}): {record['outcome']}: {record['message']}"
    values = values_of(solution.solved_scene)
    if balance := solution.settings.get("balance"):
        values |= {"balance.load": balance["load"], balance["vary"]: balance["value"]}
    tables = [sensitivity.text(one, solution, values) for one in found]
    return "\n".join([f"{record['scene']} ({shape})", *tables])
