"""The commands: argv's namespace -> calls; prints the summary or the JSON; returns the exit status."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from mpi4py import MPI

from ..api import solve
from ..base.options import check_unread
from ..drivers.ask import Ask
from ..errors import InputError, nearest
from ..output.results import as_dict, finite, summary
from ..problems.solution import Solution, Step
from ..registry import METHODS, STABILITY, SYSTEMS, recipe_line, recipe_names
from ..scenes.scene import Scene, load_scene, parse_changes, scene_line, scene_names
from ..solvers.newton import Monitor
from .arguments import method_options, scene_changes


def run(args: argparse.Namespace) -> int:
    """Run the command; exit status 0 or 1. Collective.

    Raises
    ------
    InputError : bad input, for exit status 2.
    """
    return COMMANDS[args.command](args)


def say(text: str) -> None:
    """Print on rank 0.

    Raises
    ------
    InputError : on rank 0, standard output cannot take it (a full disk).
    """
    if MPI.COMM_WORLD.rank == 0:
        try:
            print(text, flush=True)
        except OSError as error:
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115  (else Python tries to flush it once more at its end)
            raise InputError(f"standard output: {error.strerror}") from None


def scene_of(args: argparse.Namespace, more: dict[str, Any] | None = None) -> Scene:
    """The scene with the command line's changes, and more of them."""
    changes = parse_changes(scene_changes(args)[0])
    for key in ("n", "nx", "ny", "film"):
        if getattr(args, key) is not None:
            changes[key] = getattr(args, key)
    return load_scene(args.scene, {**changes, **(more or {})})


def stopping_of(args: argparse.Namespace) -> dict[str, Any]:
    """The tolerances that were given, and the iteration limit."""
    given = {name: value for name in ("eps1", "eps2") if (value := getattr(args, name)) is not None}
    for name, value in given.items():
        if not 0 < value < 1:
            raise InputError(f"--{name} {value}: allowed are numbers between 0 and 1")
    if args.max_it < 1:
        raise InputError(f"--max-it {args.max_it}: at least 1 is needed")
    return {**given, "max_it": args.max_it}


def options_of(args: argparse.Namespace, method: str, among: Sequence[str] = ()) -> dict[str, Any]:
    """The method's options from flags and from --set METHOD.OPTION=VALUE; such options of others `among` are theirs."""
    options = method_options(args)
    for key, value in parse_changes(scene_changes(args)[1]).items():
        owner, _, name = key.partition(".")
        if owner == method:
            options[name] = value
        elif owner not in among:
            raise InputError(f"--set {key}: an option of method {owner}, and the method is {method}; add --method {owner}")
    return options


def ask_of(args: argparse.Namespace, monitor: Monitor | None = None) -> Ask:
    """How to solve, of the options that `solve` and `sweep` share."""
    return Ask(
        method=args.method,
        system=args.system,
        recipe=args.recipe,
        stopping=stopping_of(args),
        options=options_of(args, args.method),
        nested=args.nested,
        monitor=monitor,
    )


def solution_of(args: argparse.Namespace, monitor: Monitor | None = None) -> Solution:
    """What `solve` with these arguments finds. Collective."""
    scene = scene_of(args)
    return solve(
        scene,
        ask_of(args, monitor),
        accuracy=args.accuracy,
        quantity=args.quantity,
        finest=scene.shape if args.n or args.nx or args.ny else None,
        certify=args.certify,
        checkpoint=args.checkpoint,
        every=args.every or 1,
        resume=args.resume,
        reduction=args.reduction,
        memory_check=not args.no_memory_check,
    )


def run_solve(args: argparse.Namespace) -> int:
    if args.every is not None and (args.checkpoint is None or args.every < 1):
        raise InputError(f"--every {args.every}: at least 1, and --checkpoint FILE, are needed")
    from ..output import files

    for path in args.output:
        files.check_target(path)
    if args.plot:
        files.check_target(args.plot, plot=True)

    def monitor(k: int, step: Step) -> None:
        if k == 1:
            check_unread()
        if args.monitor and MPI.COMM_WORLD.rank == 0:
            print(monitor_line(k, step), file=sys.stderr, flush=True)

    solution = solution_of(args, monitor)
    try:
        check_unread()
        if args.explain and MPI.COMM_WORLD.rank == 0:
            print("\n".join(solution.settings["why"]), file=sys.stderr, flush=True)
        data = as_dict(solution)
        say(json.dumps(finite(data)) if args.json else summary(data))
        failed = []  # a file that cannot be written costs neither the result nor the other files
        for path in args.output:
            try:
                files.save(solution, path)
            except InputError as error:
                failed.append(str(error))
        if args.plot:
            from ..output.plot import plot

            try:
                plot(solution, args.plot)
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
    )
    check_unread()
    say(json.dumps(finite(rows)) if args.json else table(rows))
    return 0 if all(row["converged"] for row in rows) else 1


def run_table(args: argparse.Namespace) -> int:
    from ..studies.tables import run_published_table

    return run_published_table(args.paper, args.number, args.quick, args.results, fitted=args.fitted, stored=args.stored)


def run_chart(args: argparse.Namespace) -> int:
    if args.chart == "precision":
        from ..studies.precision import chart

        return chart(args.scenes, quick=args.quick, results=args.results)
    if args.chart == "scaling":
        from ..studies import scaling

        return scaling.chart(quick=args.quick, results=args.results)
    for name in args.maps:
        if name not in STABILITY:
            raise InputError(f"chart stability {name}: allowed are {', '.join(STABILITY)}{nearest(name, STABILITY)}")
    return max(STABILITY[name].load()(quick=args.quick, results=args.results) for name in args.maps or STABILITY)


def run_verify(args: argparse.Namespace) -> int:
    from .verify import run

    return run(args)


def run_doctor(args: argparse.Namespace) -> int:
    from .doctor import run

    return run(args)


def run_sweep(args: argparse.Namespace) -> int:
    from .sweep import run

    return run(args)


def run_new(args: argparse.Namespace) -> int:
    from ..scenes.template import run

    return run(args.file, args.source)


def run_list(args: argparse.Namespace) -> int:
    groups = {
        "scenes": {name: scene_line(name) for name in scene_names()},
        "methods": {name: entry.line for name, entry in METHODS.items()},
        "systems": {name: entry.line for name, entry in SYSTEMS.items()},
        "recipes": {name: recipe_line(name) for name in recipe_names()},
    }
    for title, lines in groups.items():
        say(f"{title}:")
        for name, line in lines.items():
            say(f"  {name:<16} {line}")
    return 0


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "solve": run_solve,
    "compare": run_compare,
    "sweep": run_sweep,
    "table": run_table,
    "chart": run_chart,
    "verify": run_verify,
    "doctor": run_doctor,
    "new": run_new,
    "list": run_list,
}
