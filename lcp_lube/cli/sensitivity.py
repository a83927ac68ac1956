"""`lcp-lube sensitivity`: which number of a scene matters how much, and where the film does."""

import argparse
import json
from typing import Any

from ..api import solve
from ..base.options import check_unread
from ..drivers.adjoint import Adjoint
from ..drivers.equations import check_film
from ..drivers.film_gradient import FilmGradient
from ..drivers.gradient import Gradient, gradients
from ..output import files, sensitivity
from ..output.console import say
from ..output.results import as_dict, finite
from ..problems.solution import Solution
from ..scenes.scene import Scene
from ..scenes.values import key_of, values_of
from .asked import ask_of, scene_of

HEAD = ("scene", "nx", "ny", "outcome", "converged", "message")


def run(args: argparse.Namespace) -> int:
    """Exit status 0 if the film's solution converged, else 1. Collective.

    Raises
    ------
    InputError : a quantity or a key without a derivative, a file that cannot be written.
    """
    scene = scene_of(args)
    check_film(scene)
    names = [name.strip() for name in args.quantity.split(",")]
    keys = [word.strip() for word in args.by.split(",")] if args.by else None
    for key in keys or []:
        if key != "balance.load":
            key_of(scene, key)
    if args.plot:
        files.check_target(args.plot, plot=True)
    if args.output:
        files.check_target(args.output)
    solution = solve(scene, ask_of(args))
    try:
        check_unread()
        data = as_dict(solution)
        record: dict[str, Any] = {key: data.get(key) for key in HEAD}
        if solution.converged:
            found = gradients(scene, solution, names, keys)
            record |= sensitivity.as_dict(found[0], solution)
            if found[1:]:
                record["others"] = [sensitivity.as_dict(one, solution) for one in found[1:]]
            pictures(args, scene, solution, found)
        if args.json:
            say(json.dumps(finite(record)))
        else:
            say(text(record, scene, solution, found if solution.converged else []))
    finally:
        solution.destroy()
    return 0 if solution.converged else 1


def pictures(args: argparse.Namespace, scene: Scene, solution: Solution, found: list[Gradient]) -> None:
    """The film's derivative, drawn and written where that was asked for. Collective."""
    if not (args.plot or args.output):
        return
    names = [one.quantity for one in found]
    adjoint = Adjoint(scene, solution, names)
    try:
        film = FilmGradient(adjoint, solution.settings.get("balance"))
        fields = {name: film.field(name) for name in (names if args.output else names[:1])}
    finally:
        adjoint.destroy()
    if args.plot:
        sensitivity.plot(found[0], solution, fields[names[0]], args.plot)
    if args.output:
        dim = solution.problem.grid.dim
        units = {name: sensitivity.field_unit(sensitivity.unit_of(solution, name), dim) for name in names}
        shape = solution.problem.grid.box if dim == 2 else (-1,)
        more = {f"d{name}_dh": (fields[name].reshape(shape), units[name]) for name in names}
        files.save(solution, args.output, more=more)


def text(record: dict[str, Any], scene: Scene, solution: Solution, found: list[Gradient]) -> str:
    """Tables for people."""
    shape = " x ".join(str(record[side]) for side in ("nx", "ny") if record[side])
    if not found:
        return f"{record['scene']} ({shape}): {record['outcome']}: {record['message']}"
    values = values_of(solution.solved_scene)
    if balance := solution.settings.get("balance"):
        values |= {"balance.load": balance["load"], balance["vary"]: balance["value"]}
    tables = [sensitivity.text(one, solution, values) for one in found]
    return "\n".join([f"{record['scene']} ({shape})", *tables])
