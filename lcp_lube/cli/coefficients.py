"""`lcp-lube coefficients`: stiffness, damping and stability of a journal's film."""

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..api import solve
from ..base.options import check_unread
from ..drivers.coefficients import Coefficients, coefficients, placed, stability
from ..errors import InputError
from ..output.console import say
from ..output.files import replacing
from ..output.results import as_dict, finite
from ..scenes.scene import Scene, as_scene
from .asked import ask_of, scene_of
from .sweep import parse_axis

ROTOR = ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")  # N/m and N s/m, of frequency (rad/s), the speed
KEYS = ("S", "sommerfeld", "eccentricity", "attitude_deg", "load")


def run(args: argparse.Namespace) -> int:
    """Exit status 0 if the film's solution converged, else 1. Collective.

    Raises
    ------
    InputError : a scene without a journal, a frequency that is none.
    """
    scene = scene_of(args)
    try:
        frequencies = [float(word) for word in args.frequency.split(",")]
    except ValueError:
        raise InputError(f"--frequency {args.frequency}: numbers in rad/s are needed, with commas between them") from None
    if getattr(scene, "turning", None) is None:
        raise InputError(f"scene {scene.name}: coefficients are of journals; it has no part that could be displaced")
    if args.speeds is not None:
        return table(args, scene, frequencies)
    if args.output is not None:
        raise InputError(f"--output {args.output}: --speeds FROM:TO:N is needed too")
    solution = solve(scene, ask_of(args))
    try:
        check_unread()
        data = as_dict(solution)
        record = {key: data.get(key) for key in ("scene", "nx", "ny", "outcome", "converged", "message", *KEYS)}
        if solution.converged:
            found = coefficients(scene, solution, frequencies)
            record |= report(found, placed(scene, solution), data)
        say(json.dumps(finite(record)) if args.json else text(record))
    finally:
        solution.destroy()
    return 0 if solution.converged else 1


def table(args: argparse.Namespace, scene: Scene, frequencies: list[float]) -> int:
    """A csv row a speed, in the columns and axes of rotor programs. Collective.

    Theirs: x to the right, y upwards, the journal turning from x to y; the load is its weight, along -y. Our x is -y, our y
    is x.

    Raises
    ------
    InputError : a scene without speed_rpm, a file that cannot be written.
    """
    if "speed_rpm" not in type(scene).model_fields:
        raise InputError(f"--speeds: scene {scene.name} has no speed_rpm")
    speeds = parse_axis(f"speed_rpm={args.speeds}").values
    rows, near, failed = [], None, 0
    for rpm in speeds:
        at = as_scene(scene, {"speed_rpm": float(rpm)})
        solution = solve(at, ask_of(args), start=near)
        check_unread()
        if near is not None:
            near.destroy()
        if solution.converged:
            (one,) = coefficients(at, solution, frequencies[:1])
            turn = np.array([[0.0, -1.0], [1.0, 0.0]])  # our axes as columns, in theirs
            K, C = (turn.T @ matrix @ turn for matrix in (one.K, one.C))
            values = [at.omega, *K.ravel(), *C.ravel()]  # type: ignore[attr-defined]
            rows.append(",".join(f"{value:.9g}" for value in values))
        failed += not solution.converged
        near = solution
    if near is not None:
        near.destroy()
    lines = "\n".join([",".join(("frequency", *ROTOR)), *rows]) + "\n"
    if args.output is None:
        say(lines.rstrip("\n"))
    else:
        with replacing(args.output, MPI.COMM_WORLD) as name:
            if MPI.COMM_WORLD.rank == 0:
                Path(name).write_text(lines)
    return 1 if failed else 0


def report(found: list[Coefficients], scene: Scene, data: dict[str, Any]) -> dict[str, Any]:
    """The coefficients as the JSON has them, and what a rigid rotor on them does (at the first frequency)."""
    turning = scene.turning  # type: ignore[attr-defined]
    W = data["load"]
    scale = turning.c / W if W > 0 else math.nan  # nothing to measure by where nothing is carried
    scaled = [(one.K * scale, one.C * scale * turning.omega) for one in found]
    rows = [
        {
            "frequency": one.frequency,
            "K": one.K.tolist(),
            "C": one.C.tolist(),
            "K_dimensionless": K.tolist(),
            "C_dimensionless": C.tolist(),
        }
        for one, (K, C) in zip(found, scaled, strict=True)
    ]
    whirl, threshold = stability(*scaled[0]) if W > 0 else (None, None)
    psi, D = turning.c / turning.R, 2.0 * turning.R
    S = scene.mu * turning.omega / (2.0 * math.pi) * turning.B * D * scale / (turning.c * psi**2)  # type: ignore[attr-defined]
    eccentricity = scene.eccentricity  # type: ignore[attr-defined]
    return {"S": S, "eccentricity": eccentricity, "coefficients": rows, "whirl_ratio": whirl, "threshold": threshold}


def text(record: dict[str, Any]) -> str:
    """A few lines for people."""
    if "coefficients" not in record:
        return f"{record['scene']}: {record['outcome']}: {record['message']}"
    lines = [
        f"{record['scene']} ({record['nx']} x {record['ny']}): eccentricity {record['eccentricity']:.6g}, attitude "
        f"{record['attitude_deg']:.5g} deg, load {record['load']:.6g} N, S {record['S']:.5g}",
        "x along the load, y a quarter of a turn ahead; in brackets K c/W and C c omega/W",
    ]
    for one in record["coefficients"]:
        lines.append(f"at {one['frequency']:g} rad/s")
        for name, unit in (("K", "N/m"), ("C", "N s/m")):
            for i, row in enumerate(one[name]):
                plain = one[f"{name}_dimensionless"][i]
                cells = "  ".join(f"{name}{'xy'[i]}{'xy'[j]} {row[j]:12.5g} [{plain[j]:9.5f}]" for j in (0, 1))
                lines.append(f"  {cells}  {unit}")
    if record["threshold"] is None:
        lines.append("no threshold of stability" if record["load"] > 0 else "nothing is carried: no numbers in brackets")
    else:
        lines.append(
            f"rigid rotor: whirl ratio {record['whirl_ratio']:.4g}, unstable beyond omega sqrt(c/g) = {record['threshold']:.4g}"
        )
    return "\n".join(lines)
