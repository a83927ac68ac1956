"""A Solution as the JSON object of the command line, and as a summary to read."""

import os
import platform
from pathlib import Path
from typing import Any

import mpi4py
import numpy as np
import petsc4py
from petsc4py import PETSc

from .. import __version__
from ..problems.solution import Solution
from ..scenes.doubts import doubts, too_high
from ..scenes.effects.named import sentence
from .units import place, with_unit

ACCURACY = ("accuracy", *(f"accuracy_{name}" for name in ("quantity", "estimate", "extrapolated", "grid_value")))


@np.errstate(over="ignore", invalid="ignore")
def as_dict(solution: Solution) -> dict[str, Any]:
    """The keys of the command line's --json, in their order; the same on every rank."""
    problem, grid = solution.problem, solution.problem.grid
    certificate, settings = solution.certificate, solution.settings
    last = solution.steps[-1] if solution.steps else None
    quantities = solution.numbers
    return {
        "scene": settings.get("scene"),
        "nx": grid.shape[0],
        "ny": grid.shape[1] if grid.dim == 2 else None,
        "unknowns": problem.unknowns,
        "ranks": grid.starts.size - 1,  # the communicator ends with the last of PETSc's objects on it
        "method": solution.asked,
        "took_over": solution.took_over,
        **{key: settings.get(key) for key in ("system", "scheme", "recipe", "ksp_type", "pc_type")},
        "outcome": str(solution.outcome),
        **{key: getattr(solution, key) for key in ("converged", "message", "iterations")},
        **{key: solution.total(key) for key in ("backtracking", "centrality", "linear_iterations")},
        "c1": last.norm if last else None,
        "c2": last.step_norm if last else None,
        **quantities,
        **certificate.extremes,
        **certificate.measures,
        "certificate_tol": certificate.tol,
        **(solution.enclosure.as_dict() if solution.enclosure else {}),
        **{key: settings[key] for key in ACCURACY if key in settings},
        **({"estimates": solution.estimates} if "accuracy" in settings else {}),
        **{key: settings[key] for key in ("balance", "model") if key in settings},
        **settings.get("details", {}),
        **({"levels": solution.levels} if solution.levels else {}),
        "warnings": [*doubts(solution.solved_scene), *too_high(quantities)],
        **scene_of(solution),
        **{key: settings.get(key) for key in ("memory_mb", "memory_estimate_mb", "memory_base_mb")},
        "time_s": seconds(solution.times),
        "versions": versions(),
    }


def scene_of(solution: Solution) -> dict[str, Any]:
    """What was solved, in SI units, and the units of its keys."""
    scene = solution.solved_scene
    if scene is None:  # a part of somebody's solve
        return {}
    data = scene.data_si()
    if "nx" in data:
        data.pop("n", None)  # which these have replaced
    return {"scene_data": data, "scene_units": scene.data_units()}


def seconds(times: dict[str, float]) -> dict[str, float]:
    """`Solution.times` as the JSON has them: parts that add up to the total, `other` being what has no name of its own.

    `cycles`: of nonlinear multigrid, which solves no linear systems; `certify`: of the band that was asked for.
    """
    parts: dict[str, float] = {
        "setup": times.get("setup", 0.0),
        "assembly": times.get("assembly", 0.0) + times.get("Jacobian", 0.0),
        "linear": times.get("KSP", 0.0),
        "step_length": times.get("step length", 0.0),
        **{name: times[name] for name in ("cycles", "certify") if name in times},
    }
    total = times.get("total", sum(parts.values()))
    return {"total": total, **parts, "other": max(total - sum(parts.values()), 0.0)}


def versions() -> dict[str, str]:
    """What a result depends on."""
    return {
        "lcp_lube": __version__,
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
        "petsc4py": petsc4py.__version__,
        "mpi4py": mpi4py.__version__,
        "numpy": np.__version__,
    }


def machine() -> str:
    """What the seconds depend on: processor and number of cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.processor())
    return f"{model or platform.machine()}, {os.cpu_count()} cores"


def finite(value: Any) -> Any:
    """NaN and infinities as None: JSON has no numbers for them."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


# What the summary prints of a problem that is not a bearing, and of its certificate, where a problem has it.
QUANTITIES = (
    *("max_v", "sum_v", "max_error", "contact_lower", "contact_upper", "k", "x_b", "h_min", "p_max"),
    *("rupture_time", "sigma", "sigma_time", "front", "reformation_time"),  # squeeze films
)
MEASURES = (
    *("residual", "natural_residual", "complementarity", "mass_defect", "p_error", "balance"),
    *("coupling", "energy_residual", "heat_defect", "min_p", "min_r"),
)
UNITS = {"min_p": " Pa"}
MOST_FRONTS = 4  # that are listed one by one


def _bearing_lines(data: dict[str, Any], one_d: bool) -> list[str]:
    """The summary's lines on a bearing beyond pressure and load: a journal's numbers, fronts, places, losses, flows."""
    per, flow_unit = ("/m", "m2/s") if one_d else ("", "m3/s")
    lines = []
    if data.get("force"):
        told = [f"force on the shaft ({', '.join(with_unit(part, 'N' + per, 6) for part in data['force'])})"]
        if data["attitude_deg"] is not None:
            told.append(f"attitude angle {data['attitude_deg']:.5g} deg")
        if data.get("sommerfeld") is not None:
            told.append(f"Sommerfeld number {data['sommerfeld']:.6g}")
        lines.append(", ".join(told))
    if data.get("balance"):
        found = data["balance"]
        carried = with_unit(found["carried"], "N" + per, 6)
        lines.append(f"balance: {found['vary']} = {found['value']:.8g} carries {carried}, found in {found['solves']} solves")
    if places := ", ".join(filter(None, (_fronts(name, data) for name in ("rupture", "reformation")))):
        lines.append(places + ("" if one_d else " (on the middle line)"))
    thinnest = f"thinnest film {with_unit(data['min_h'], 'm')} at {place(data['min_h_at']) or '-'}"
    lines.append(f"p_max at {place(data['p_max_at']) or '-'}; {thinnest}")
    coefficient = data["friction_coefficient"]
    losses = "" if coefficient is None else f"friction coefficient {coefficient:.4g}, "
    flows = ", ".join(f"{side} {value:.4g}" for side, value in data["flow"].items())
    lines.append(f"{losses}power loss {with_unit(data['power_loss'], 'W' + per)}; flow out: {flows} {flow_unit}")
    if data.get("supply_p"):
        pairs = zip(data["supply_p"], data["supply_flow"], strict=True)
        supplied = ", ".join(f"{with_unit(p, 'Pa', 6)} {flow:.4g}" for p, flow in pairs)
        lines.append(f"supplies, pressure and flow into the film: {supplied} {flow_unit}")
    if data.get("temperature_max") is not None:
        hot = ", ".join(f"{name} {data[f'temperature_{name}']:.5g}" for name in ("max", "effective", "out"))
        into, out = (with_unit(data[key], "W" + per) for key in ("heat_power", "heat_out"))
        stored = f", stored {with_unit(data['heat_stored'], 'W' + per)}" if "heat_stored" in data else ""
        lines.append(f"temperature {hot} K; heat in {into}, out {out}{stored}")
    if data.get("flow_growth"):
        growth = ", ".join(f"{side} {value:+.2g}" for side, value in data["flow_growth"].items() if value)
        meet = "sides, or a supply and a side, of unequal pressure meet"
        lines.append(f"these flows have no limit: {meet}; each halving of the spacings adds {growth}")
    return lines


def _fronts(name: str, data: dict[str, Any]) -> str:
    """'rupture 2 mm', 'ruptures 2, 7 mm', or the first one and how many there are; empty without one."""
    places = [f"{1e3 * x:.5g}" for x in data[f"{name}s"]]
    if len(places) > MOST_FRONTS:
        return f"{len(places)} {name}s from {places[0]} to {places[-1]} mm"
    return f"{name}{'s' * (len(places) > 1)} {', '.join(places)} mm" if places else ""


@np.errstate(over="ignore", invalid="ignore")
def summary(data: dict[str, Any]) -> str:
    """A few lines for people."""
    one_d = data["ny"] is None
    size = f"n = {data['nx']}" if one_d else f"{data['nx']} x {data['ny']}"
    load_unit = "N/m" if one_d else "N"
    inner = f", {data['linear_iterations']} Krylov" if data["linear_iterations"] else ""
    recipe = data["recipe"] or f"{data['ksp_type']} + {data['pc_type']}"
    system = f" on the {data['system']} system, {recipe}" if data["system"] else ""
    scheme = f", scheme {data['scheme']}" if data["scheme"] else ""
    first = f", from which {data['took_over']} took over" if data["took_over"] else ""
    measures = ", ".join(
        f"{name.replace('_', ' ')} {data[name]:.1e}{UNITS.get(name, '')}"
        for name in MEASURES
        if isinstance(data.get(name), float)
    )
    if "load" in data:
        quantities = (
            f"p_max {data['p_max'] / 1e6:.6g} MPa, load {data['load']:.6g} {load_unit}, friction {data['friction']:.6g} "
            f"{load_unit}, cavitated {100 * data['cavitated_fraction']:.1f} %"
        )
    else:
        quantities = ", ".join(f"{name} {data[name]:.8g}" for name in QUANTITIES if data.get(name) is not None)
    ranks = f"{data['ranks']} rank{'s' * (data['ranks'] > 1)}"
    lines = [
        f"{data['scene'] or 'film'} ({size}{scheme}) by {data['method']}{first}{system}, {ranks}",
        f"{data['outcome']}: {data['iterations']} iterations{inner}, {data['centrality']} centrality and "
        f"{data['backtracking']} backtracking cuts, {data['time_s']['total']:.2f} s; {data['message']}",
        quantities,
        f"certificate (tol {data['certificate_tol']:.0e}): {measures}",
    ]
    if "load" in data:
        lines[3:3] = _bearing_lines(data, one_d)
    if "model" in data:
        lines.append(f"model: {sentence(data['model'])}")
    if "accuracy_estimate" in data:
        name, own = data["accuracy_quantity"], ""
        if data["accuracy_extrapolated"]:  # of what a balance has found it stands nowhere else
            best = data["estimates"][name]["value"]
            own = f"; extrapolated to {best:.6g}, this grid's own is {data['accuracy_grid_value']:.6g}"
        error = data["accuracy_estimate"]
        known = f"estimated relative error {error:.1e}" if np.isfinite(error) else "its error is not known"
        grids = f"{len(data['levels'])} grid{'s' * (len(data['levels']) > 1)}"
        lines.append(f"{name}: {known} ({data['accuracy']:g} was asked for), {grids}{own}")
    if data.get("certified"):
        held = f"; {data['certified_held']}" if data.get("certified_held") else ""
        lines.append(
            f"proved: the exact discrete solution is within {data['band_p']:.1e} Pa of p, {data['band_p_max']:.1e} Pa of "
            f"p_max, {data['band_load']:.1e} {load_unit} of the load (the grid's own error comes on top{held})"
        )
    elif "certified" in data:
        lines.append(f"not proved: {data['certified_message']}")
    return "\n".join(lines)
