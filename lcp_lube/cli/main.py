"""The commands: argv's namespace -> calls; prints the summary or the JSON; returns the exit status."""

import argparse
import json
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from ..base.options import check_unread
from ..base.progress import Line
from ..errors import InputError, nearest
from ..output.console import coloured, note, say
from ..output.results import as_dict, finite, summary
from ..output.table import table as text_table
from ..problems.solution import Step
from ..registry import DRIVERS, FAMILIES, METHODS, RUNGS, SHAPES, STABILITY, SYSTEMS, recipe_line, recipe_names
from ..scenes.scene import scene_line, scene_names
from .asked import options_of, scene_of, solution_of, stopping_of


def run(args: argparse.Namespace) -> int:
    """Run the command; exit status 0 or 1. Collective. As all commands it raises InputError for bad input, exit status 2."""
    return COMMANDS[args.command](args)


def run_solve(args: argparse.Namespace) -> int:
    if args.every is not None and (args.checkpoint is None or args.every < 1):
        raise InputError(f"--every {args.every}: at least 1, and --checkpoint FILE, are needed")
    if args.boundary and not args.output:
        raise InputError("--boundary: --output FILE is needed")
    from ..output import files
    from .watching import Watching

    scene = scene_of(args)
    watching = Watching(args, scene)
    moves = watching.table is not None
    outputs = [path for path in args.output if not (moves and path.lower().endswith(".pvd"))]
    for path in outputs:
        files.check_target(path)
    for path in filter(None, (None if moves else args.plot, args.plot_model)):
        files.check_target(path, plot=True)

    def monitor(k: int, step: Step) -> None:
        if k == 1:
            check_unread()
        if args.monitor:
            note(monitor_line(k, step))

    try:
        with Line() as line:
            quiet = args.monitor or moves  # a march has a bar of its own
            solution = solution_of(args, monitor, None if quiet else line, watching if moves else None, scene)
    finally:
        watching.close()
    try:
        check_unread()
        if args.explain:
            note("\n".join(solution.settings["why"]))
        data = as_dict(solution)
        for doubt in data["warnings"]:
            note(f"lcp-lube: warning: {doubt}")
        say(json.dumps(finite(data)) if args.json else coloured(summary(data), data["outcome"], data["converged"]))
        writers: list[Callable[[], None]] = [partial(files.save, solution, path, args.boundary) for path in outputs]
        if args.plot:
            writers.append(partial(watching.draw, solution) if moves else partial(solution.plot, args.plot))
        if args.plot_model:
            from ..output.model_picture import plot_model

            model = solution.settings.get("model", {"reason": "the scene names no effects"})
            writers.append(partial(plot_model, model, args.plot_model))
        failed = []  # a file that cannot be written costs neither the result nor the other files
        for write in writers:
            try:
                write()
            except InputError as error:
                failed.append(str(error))
    finally:
        solution.destroy()
    if failed:
        raise InputError("; ".join(failed))
    return 0 if solution.converged else 1


def monitor_line(k: int, step: Step) -> str:
    return (
        f"{k:4d}  ||F|| {step.norm:.6e}  ||alpha d|| {step.step_norm:.3e}  alpha {step.alpha:.3e}  "
        f"sigma {step.sigma:.1e}  cuts {step.centrality}+{step.backtracking}  rtol {step.rtol:.1e}  "
        f"linear its {step.linear_iterations}"
    )


def run_compare(args: argparse.Namespace) -> int:
    from ..studies.compare import compare, table

    rows = compare(
        scene_of(args),
        methods=args.methods.split(","),
        recipes=[name for name in args.recipes.split(",") if name] or [None],
        system=args.system,
        stopping=stopping_of(args),
        options=lambda method: options_of(args, method, args.methods.split(",")),
        nested=args.nested,
        rescue=not args.no_rescue,
    )
    check_unread()
    say(json.dumps(finite(rows)) if args.json else table(rows))
    return 0 if all(row["converged"] for row in rows) else 1


def run_table(args: argparse.Namespace) -> int:
    from ..studies.tables import run_published_table

    how = {"quick": args.quick, "fitted": args.fitted, "stored": args.stored}
    return run_published_table(args.paper, args.number, results=args.results, **how)


def run_chart(args: argparse.Namespace) -> int:
    study: Any = None if args.chart == "stability" else import_module(f"..studies.{args.chart}", __package__)
    if args.chart == "precision":
        return study.chart(args.scenes, quick=args.quick, results=args.results)
    if study is not None:
        return study.chart(quick=args.quick, results=args.results)
    for name in args.maps:
        if name not in STABILITY:
            raise InputError(f"chart stability {name}: allowed are {', '.join(STABILITY)}{nearest(name, STABILITY)}")
    return max(STABILITY[name].load()(quick=args.quick, results=args.results) for name in args.maps or STABILITY)


def run_list(args: argparse.Namespace) -> int:
    groups: dict[str, Any] = {
        "scenes": {name: scene_line(name) for name in scene_names()},
        "families of scenes": FAMILIES,
        "methods": METHODS,
        "systems": SYSTEMS,
        "recipes": {name: recipe_line(name) for name in recipe_names()},
        "film shapes": SHAPES,
        "effects": RUNGS,
        "drivers, outermost first": DRIVERS,
        "maps of chart stability": STABILITY,
    }
    for title, group in groups.items():
        lines = {name: getattr(one, "line", one) for name, one in group.items()}
        say(f"{title}:")
        say("\n".join(text_table([*lines.items()], align="<<", least=[16], gap=" ", indent="  ")))
    return 0


def run_elsewhere(args: argparse.Namespace) -> int:
    """A command with a file of its own, loaded where it is asked for."""
    return import_module(f".{args.command}", __package__).run(args)


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "solve": run_solve,
    "compare": run_compare,
    **dict.fromkeys(("sweep", "coefficients", "sensitivity", "optimise", "explore"), run_elsewhere),
    "table": run_table,
    "chart": run_chart,
    **dict.fromkeys(("verify", "doctor"), run_elsewhere),
    "new": lambda args: import_module("..scenes.template", __package__).run(args.file, args.source),
    "list": run_list,
}
