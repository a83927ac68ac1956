"""`lcp-lube coefficients`: stiffness, damping and stability of a journal's film."""

import argparse
import json
import math
from typing import Any

from ..api import solve
from ..base.options import check_unread
from ..drivers.coefficients import Coefficients, coefficients, stability
from ..errors import InputError
from ..output.console import say
from ..output.results import as_dict, finite
from ..scenes.scene import Scene
from .asked import ask_of, scene_of

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
    solution = solve(scene, ask_of(args))
    try:
        check_unread()
        data = as_dict(solution)
        record = {key: data.get(key) for key in ("scene", "nx", "ny", "outcome", "converged", "message", *KEYS)}
        if solution.converged:
            found = coefficients(scene, solution, frequencies)
            record |= report(found, scene, data)
        say(json.dumps(finite(record)) if args.json else text(record))
    finally:
        solution.destroy()
    return 0 if solution.converged else 1


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
