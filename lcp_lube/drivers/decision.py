"""No more physics than counts: effects that change the quantity asked for by less than a tenth of the tolerance are left out.

On a coarse grid the scene is solved with all the effects that it names, and once without each. Those that change the quantity
by less than a tenth of the tolerance (`accuracy`, else 1 %) are not solved for on the scene's own grid; each is told, with its
sign and size. Of two that do the same either alone may go, but not both: where several are to be left out, it is solved without
all of them too, and the largest are kept until what is left out together changes as little. At most as many coarse films are
solved as `SHARE` of the work allows (a part of it more for that); a grid too small for that has all effects.
"""

from dataclasses import replace
from math import isfinite, prod
from typing import Any

from ..errors import InputError
from ..problems.solution import Solution
from ..registry import RUNGS
from ..scenes.effects.named import check_names, named, sentence, without
from ..scenes.scene import Scene, Solvable
from .accuracy import DEFAULT_QUANTITY, find_value
from .ask import Ask
from .compose import Inner

TOLERANCE = 0.01  # of the quantity, unless an accuracy is asked for
PART = 0.1  # of the tolerance: what changes the quantity by less is left out, so that ten such effects stay within it
SHARE = 0.10  # of the fine solve's work that coarse ones may take, by points: films differ in number, 0.15 is promised
LEAST = {1: 15, 2: 6}  # points a side of a coarse grid, at least
FREE = {"barus"}  # alone it is a change of the unknown, and costs nothing
COARSE_EPS1 = 1e-7


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene names effects, of which some may be left out."""
    return (isinstance(scene, Scene) and bool(named(scene))) or ask.model not in ("auto", "full", "least")


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution with those effects that count. Collective.

    Returns
    -------
    Solution : settings['model'] has what was kept and left out, with effects (dQ/Q) where they were taken.

    Raises
    ------
    InputError : effects named that there are not, or that the scene has no data for.
    """
    names = named(scene)
    effects: dict[str, float] = {}
    record: dict[str, Any] = {}
    if ask.model in ("full", "least"):
        kept, record = (names if ask.model == "full" else []), {"reason": f"{ask.model} model asked for"}
    elif ask.model != "auto":
        kept = [word.strip() for word in ask.model.split(",")]
        check_names(kept)
        for name in kept:
            if name not in names:
                has = f"it has {', '.join(names)}" if names else "it has none"
                raise InputError(f"--model {name}: scene {scene.name} has no data for it; {has}")
        record = {"reason": "named"}
    else:
        kept, effects, record = _decided(scene, names, ask, inner)
    gone = [name for name in names if name not in kept]
    solution = inner(without(scene, gone) if gone else scene, ask)
    work = total_work(solution)
    if "coarse_work" in record:
        record["share_of_work"] = record.pop("coarse_work") / work
    model = {
        "kept": {name: effects.get(name) for name in names if name in kept},
        "left_out": {name: effects.get(name) for name in gone},
        **record,
    }
    solution.settings["model"] = model
    solution.because(f"model: {sentence(model)}", after=True)
    return solution


def coarse_shape(shape: tuple[int, ...], solves: int) -> tuple[int, ...] | None:
    """The grid for the decision: so many solves on it cost `SHARE` of one on `shape`; None where it would be too small."""
    factor = (SHARE / solves) ** (1.0 / len(shape))
    coarse = tuple(max(1, int(factor * n)) for n in shape)
    if len(shape) == 2 and coarse[1] < LEAST[2] <= shape[1]:  # few lines: keep them, take the points along
        coarse = (int(SHARE / solves * prod(shape) / LEAST[2]), LEAST[2])
    return coarse if min(coarse) >= LEAST[len(shape)] and coarse[0] >= 2 * LEAST[2] else None


def _decided(scene: Any, names: list[str], ask: Ask, inner: Inner) -> tuple[list[str], dict[str, float], dict[str, Any]]:
    """Effects to keep, what each changes on a coarse grid, and how that was found. Collective."""
    if set(names) <= FREE:
        return names, {}, {"reason": "alone it costs nothing"}
    tol = ask.accuracy or TOLERANCE
    shape = coarse_shape(scene.shape, len(names) + 1)
    if shape is None:
        return names, {}, {"reason": "the grid is too small for a coarser one to decide on"}
    quick: dict[str, Any] = {"accuracy": None, "quantity": None, "finest": None, "start": None, "monitor": None}
    quick |= {"certify": False, "checkpoint": None, "resume": None, "stopping": {"eps1": COARSE_EPS1}}
    coarse = scene.with_shape(shape)
    try:
        full = inner(coarse, replace(ask, **quick))
    except InputError:
        return names, {}, {"reason": f"no film on the coarse grid {shape}"}
    work, effects = total_work(full), {}
    try:
        if not full.converged:
            return names, {}, {"reason": f"no answer on the coarse grid {shape}: {full.message}"}
        value, quantity = _quantity(full, ask.quantity, scene)

        def effect(gone: list[str]) -> float | None:
            """What these change together, dQ/Q."""
            nonlocal work
            bare = without(coarse, gone)
            if not named(bare):  # a line's numbers are exact without effects, and the others have the grid's error
                bare = bare.model_copy(update={"viscosity": RUNGS["viscosity"].load()(factor="1")})
            other = inner(bare, replace(ask, **{**quick, "start": full}))
            work += total_work(other)
            reference = _quantity(other, quantity, scene)[0] if other.converged else None
            other.destroy()
            if reference is None or value is None or reference == 0.0 or not isfinite(value / reference):
                return None
            return value / reference - 1.0

        effects = {name: found for name in names if (found := effect([name])) is not None}
        kept = [name for name in names if not abs(effects.get(name, 1.0)) < PART * tol]
        gone = sorted((name for name in names if name not in kept), key=lambda name: abs(effects[name]))
        together = effect(gone) if len(gone) > 1 else 0.0
        while len(gone) > 1 and (together is None or not abs(together) < len(gone) * PART * tol):
            kept.append(gone.pop())
            together = effect(gone) if len(gone) > 1 else 0.0
    finally:
        full.destroy()
    record = {"quantity": quantity, "tolerance": tol, "grid": list(shape), "coarse_work": work}
    return kept, effects, record


def _quantity(solution: Solution, quantity: str | None, scene: Any) -> tuple[float | None, str]:
    """The quantity asked for, as `accuracy` has it, and its name; None where this model has no such number."""
    found = solution.problem.quantities(solution.fields)
    balance = solution.settings.get("balance")
    if balance:
        found = {balance["vary"]: balance["value"], **found}
    name = quantity or (balance["vary"] if balance else next((one for one in DEFAULT_QUANTITY if one in found), ""))
    if quantity is not None and name not in found:
        return None, name
    return find_value(found, name, scene), name


def total_work(solution: Solution) -> float:
    """Unknowns times solves: of all films of the last balance step, times its steps."""
    each = solution.settings.get("details", {}).get("coupling_work", solution.problem.unknowns)
    return each * solution.settings.get("balance", {}).get("solves", 1)
