"""`lcp-lube coefficients`: stiffness, damping and stability of a film."""

import argparse
import json
import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ..api import solve
from ..base.files import write_text
from ..base.options import check_unread
from ..base.progress import Line
from ..drivers.chain import Chain
from ..drivers.motions.coefficients import Coefficients, check_film, check_frequencies, coefficients, placed, stability
from ..errors import InputError, NotFound
from ..output.console import say
from ..output.files import check_target
from ..output.results import as_dict, finite
from ..output.style import save_figure
from ..problems.film.turning import Turning
from ..problems.solution import Outcome
from ..scenes.scene import Scene, as_scene
from .asked import ask_of, scene_of
from .sweep import parse_axis

ROTOR = ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")  # N/m and N s/m, of frequency (rad/s), the speed
KEYS = ("S", "sommerfeld", "eccentricity", "attitude_deg", "load")


def run(args: argparse.Namespace) -> int:
    """Exit status 0 if the film's solution converged, else 1. Collective."""
    scene = scene_of(args)
    check_film(scene, args.tilt)
    try:
        frequencies = [float(word) for word in args.frequency.split(",")]
    except ValueError:
        raise InputError(f"--frequency {args.frequency}: numbers in rad/s are needed, with commas between them") from None
    check_frequencies(frequencies)
    if args.speeds is not None:
        return table(args, scene, frequencies)
    for option, file in (("--output", args.output), ("--plot", args.plot)):
        if file is not None:
            raise InputError(f"{option} {file}: --speeds FROM:TO:N is needed too")
    with Line() as line, solve(scene, replace(ask_of(args), progress=line)) as solution:
        data = as_dict(solution)
        record = {key: data.get(key) for key in ("scene", "nx", "ny", "outcome", "converged", "message", *KEYS)}
        if record["converged"]:
            line("sweep", "stiffness and damping", 0.5)
            try:
                found = coefficients(scene, solution, frequencies, args.tilt)
                record |= report(found, placed(scene, solution), data)
            except NotFound as error:
                record |= {"outcome": str(Outcome.LINEAR_SOLVER), "converged": False, "message": str(error)}
        check_unread()  # the linearised film has options of its own
        say(json.dumps(finite(record)) if args.json else text(record))
    return 0 if record["converged"] else 1


def table(args: argparse.Namespace, scene: Scene, frequencies: list[float]) -> int:
    """A csv row a speed, in the columns and axes of rotor programs. Collective.

    Theirs: x to the right, y upwards, the journal turning from x to y; the load is its weight, along -y. Our x is -y, our y
    is x.
    """
    if "speed_rpm" not in type(scene).model_fields or getattr(scene, "turning", None) is None:
        raise InputError(f"--speeds: scene {scene.name} is no journal with a speed_rpm")
    speeds = parse_axis(f"speed_rpm={args.speeds}").values
    if args.plot is not None:
        check_target(args.plot, plot=True)
    rows: list[list[float]] = []
    drawn: list[dict[str, Any]] = []
    with Line() as line:
        chain = Chain(replace(ask_of(args), progress=line), solve)  # type: ignore[arg-type]
        for rpm in line.over(speeds, lambda rpm: f"{rpm:g} rpm, speed"):
            at = as_scene(scene, {"speed_rpm": float(rpm)})
            solution, found = chain.solve(at), list[Coefficients]()
            with suppress(NotFound):
                found = coefficients(at, solution, frequencies[:1]) if solution.converged else []
            check_unread()  # the linearised film has options of its own
            for one in found:
                turn = np.array([[0.0, -1.0], [1.0, 0.0]])  # our axes as columns, in theirs
                K, C = (turn.T @ matrix @ turn for matrix in (one.K, one.C))
                rows.append([at.omega, *K.ravel(), *C.ravel()])  # type: ignore[attr-defined]
                drawn.append(report(found, placed(at, solution), as_dict(solution)))
    solution.destroy()
    told = [",".join(f"{value:.9g}" for value in row) for row in rows]
    lines = "\n".join([",".join(("frequency", *ROTOR)), *told])
    if args.output is None:
        say(lines)
    else:
        write_text(args.output, lines + "\n")
    if args.plot is not None and rows:
        from ..output.coefficients_picture import figure_of

        save_figure(lambda: figure_of(np.array(rows)[:, 0] * 30.0 / math.pi, drawn, scene.name), args.plot)
    return 0 if len(rows) == len(speeds) else 1


def report(found: list[Coefficients], scene: Scene, data: dict[str, Any]) -> dict[str, Any]:
    """The coefficients as the JSON has them, and what a rigid rotor on them does (at the first frequency)."""
    rows = [{"frequency": one.frequency, "motions": [*one.motions], "K": one.K.tolist(), "C": one.C.tolist()} for one in found]
    turning: Turning | None = getattr(scene, "turning", None)
    if turning is None:
        return {"coefficients": rows}
    W = data["load"]
    scale = turning.c / W if W > 0 else math.nan  # nothing to measure by where nothing is carried
    scaled = [(one.K[:2, :2] * scale, one.C[:2, :2] * scale * turning.omega) for one in found]
    for row, (K, C) in zip(rows, scaled, strict=True):
        row |= {"K_dimensionless": K.tolist(), "C_dimensionless": C.tolist()}
    turns = W > 0 and turning.omega > 0
    whirl, threshold = stability(*scaled[0]) if turns else (None, None)
    mass = threshold**2 * W / (turning.c * turning.omega**2) if threshold is not None else None
    eccentricity = scene.eccentricity if hasattr(scene, "eccentricity") else float(np.hypot(*scene.place))  # type: ignore[attr-defined]
    numbers = turning.numbers(W, scene.model.mu, eccentricity)  # type: ignore[attr-defined]
    return {
        "S": numbers["S"] if turns else None,
        "eccentricity": numbers["eccentricity"],
        "coefficients": rows,
        "whirl_ratio": whirl,
        "threshold": threshold,
        "threshold_mass": mass,
    }


def text(record: dict[str, Any]) -> str:
    """A few lines for people."""
    if "coefficients" not in record:
        return f"{record['scene']}: {record['outcome']}: {record['message']}"
    one_d = record["ny"] is None
    size, per = (f"n = {record['nx']}", "/m") if one_d else (f"{record['nx']} x {record['ny']}", "")
    journal = "threshold" in record
    if journal:
        attitude = "" if record["attitude_deg"] is None else f"attitude {record['attitude_deg']:.5g} deg, "
        S = "" if record["S"] is None else f", S {record['S']:.5g}"
        head = f"eccentricity {record['eccentricity']:.6g}, {attitude}load {record['load']:.6g} N{per}{S}"
        axes = "x along the load, y a quarter of a turn ahead; in brackets K c/W and C c omega/W"
    else:
        head, axes = f"load {record['load']:.6g} N{per}", "z along the film's normal, walls apart"
    lines = [f"{record['scene']} ({size}): {head}", axes]
    for one in record["coefficients"]:
        lines.append(f"at {one['frequency']:g} rad/s")
        for name, unit in (("K", f"N/m{per}"), ("C", f"N s/m{per}")):
            for i, row in enumerate(one[name]):
                if len(row) > 2:
                    lines.append(f"  {name} {one['motions'][i]:<12}" + "  ".join(f"{value:12.5g}" for value in row))
                    continue
                plain = one.get(f"{name}_dimensionless")
                told = [f"{value:12.5g}" + (f" [{plain[i][j]:9.5f}]" if plain else "") for j, value in enumerate(row)]
                labels = [f"{name}{one['motions'][i]}{one['motions'][j]}" if journal else name for j in range(len(row))]
                cells = "  ".join(f"{label} {value}" for label, value in zip(labels, told, strict=True))
                lines.append(f"  {cells}  {unit}")
    if not journal:
        return "\n".join(lines)
    if record["threshold"] is None:
        lines.append("no threshold of stability" if record["load"] > 0 else "nothing is carried: no numbers in brackets")
    else:
        lines.append(
            f"rigid rotor: whirl ratio {record['whirl_ratio']:.4g}, unstable beyond omega sqrt(c/g) = "
            f"{record['threshold']:.4g}, at this speed with more than {record['threshold_mass']:.5g} kg{per} on the bearing"
        )
    return "\n".join(lines)
