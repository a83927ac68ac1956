"""Effects by name: which a scene has data for, the scene without some, and a decision on them in words. Loads no table."""

from collections.abc import Collection, Iterable
from typing import Any

from ...errors import InputError, nearest
from ...registry import RUNGS

FLUID = {"barus": 0.0, "density": "constant"}  # effects that are keys of the table [fluid], and their values without effect


def named(scene: Any) -> list[str]:
    """The effects that a scene has data for, in the registry's order."""
    fluid = getattr(scene, "fluid", None)
    given = {name for name, none in FLUID.items() if getattr(fluid, name, none) != none}
    return [name for name in RUNGS if name in given or (name not in FLUID and getattr(scene, name, None) is not None)]


def without(scene: Any, names: Iterable[str]) -> Any:
    """The scene without these effects; the viscosity stays that of T_in where it followed from the temperature's data."""
    names = set(names)
    changes: dict[str, Any] = {name: None for name in names if name not in FLUID}
    if "temperature" in names:
        changes |= scene.isothermal()
    if of_fluid := {name: FLUID[name] for name in names & set(FLUID)}:
        changes["fluid"] = changes.get("fluid", scene.fluid).model_copy(update=of_fluid)
    return scene.model_copy(update=changes)


def check_names(names: Collection[str]) -> None:
    """Refuse a name that is no effect's.

    Raises
    ------
    InputError : with the nearest one.
    """
    for name in names:
        if name in ("auto", "full", "least"):
            raise InputError(f"--model {', '.join(names)}: {name} goes alone, without names of effects")
        if name not in RUNGS:
            raise InputError(
                f"--model {name}: allowed are auto, full, least, or names of {', '.join(RUNGS)}{nearest(name, RUNGS)}"
            )


def sentence(model: dict[str, Any]) -> str:
    """'left out: density -0.004 %; kept: temperature -14 %'."""

    def told(effects: dict[str, float | None]) -> str:
        return ", ".join(RUNGS[name].line + ("" if e is None else f" {100 * e:+.2g} %") for name, e in effects.items())

    parts = [f"{word}: {told(model[key])}" for word, key in (("left out", "left_out"), ("kept", "kept")) if model[key]]
    return "; ".join(parts) + ("" if "quantity" in model else f" ({model['reason']})")
