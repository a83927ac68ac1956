"""What a command line asks for: the scene, and how to solve it."""

import argparse
from collections.abc import Sequence
from typing import Any

from ..api import solve
from ..base.progress import Progress
from ..base.quantity import in_si, quantity
from ..drivers.ask import Ask
from ..drivers.plan import FEW
from ..errors import InputError
from ..problems.solution import Solution
from ..registry import METHODS
from ..scenes.scene import Scene, load_scene, parse_changes
from ..solvers.newton import Monitor


def scene_of(args: argparse.Namespace, more: dict[str, Any] | None = None) -> Scene:
    """The scene with the command line's changes, and more of them."""
    own = {key: value for key in ("n", "nx", "ny", "film") if (value := getattr(args, key)) is not None}
    return load_scene(args.scene, {**parse_changes(scene_changes(args)[0]), **own, **(more or {})})


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
    options = {name: value for name in ("p0", "r0", "mu", "conditions") if (value := getattr(args, name)) is not None}
    if "p0" in options:
        options["p0"] = _p0(args, options["p0"])
    for key, value in parse_changes(scene_changes(args)[1]).items():
        owner, _, name = key.partition(".")
        if owner == method:
            options[name] = value
        elif owner not in among:
            raise InputError(f"--set {key}: an option of method {owner}, and the method is {method}; add --method {owner}")
    return options


def _p0(args: argparse.Namespace, text: str) -> float:
    """The start of p in the scene's p_unit, which a pressure with a unit is turned into."""
    try:
        found = quantity(text)
        if found is None:
            return float(text)
        if not found.unit:
            return found.value
        pascals = in_si(text, "Pa")
    except InputError as error:
        raise InputError(f"--p0 {text}: {error}") from None
    except ValueError:
        raise InputError(f"--p0 {text}: a number, or a pressure with its unit, is needed") from None
    model = getattr(scene_of(args), "model", None)
    if model is None or pascals is None:
        raise InputError(f"--p0 {text}: scene {args.scene} has no pressures; a number without a unit is needed")
    return float(pascals / model.p_unit)


def ask_of(args: argparse.Namespace, monitor: Monitor | None = None) -> Ask:
    """How to solve, of the options that `solve` and `sweep` share."""
    stopping, options = stopping_of(args), options_of(args, args.method)
    named = {name: getattr(args, name) for name in ("method", "system", "recipe", "nested", "model")}
    return Ask(stopping=stopping, options=options, rescue=not args.no_rescue, monitor=monitor, **named)


def solution_of(
    args: argparse.Namespace,
    monitor: Monitor | None = None,
    progress: Progress | None = None,
    watching: Any = None,
    scene: Scene | None = None,
) -> Solution:
    """What `solve` with these arguments, and its scene where that is at hand, finds; watching: `Watching`. Collective."""
    scene = scene or scene_of(args)
    return solve(
        scene,
        ask_of(args, monitor),
        finest=scene.shape if args.n or args.nx or args.ny else None,
        every=args.every or 1,
        memory_check=not args.no_memory_check,
        direct_below=FEW,  # as for any one solve; a run to an accuracy would load multigrid's loops for this command alone
        progress=progress,
        watch=watching,
        times=watching.args_times if watching is not None else (),
        **{name: getattr(args, name) for name in ("accuracy", "quantity", "certify", "checkpoint", "resume", "reduction")},
    )


def scene_changes(args: argparse.Namespace) -> tuple[list[str], list[str]]:
    """The --set assignments for the scene (KEY or TABLE.KEY) and those for a method (METHOD.OPTION)."""
    words = {text: text.partition("=")[0].partition(".") for text in args.set}
    method = [text for text, (owner, dot, _) in words.items() if dot and owner.strip() in METHODS]
    return [text for text in args.set if text not in method], method
