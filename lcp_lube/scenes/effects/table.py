"""Tables of a scene file that name an effect's data: one file and one line in the registry (RUNGS) each.

A table makes an `Effect` (problems/film/effects). Barus' viscosity and the density's dependence on pressure stand among the
keys of the fluid; they are effects by name as well, and can be left out like the others.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from ...errors import InputError, nearest
from ...problems.film.effects import Effect
from ...registry import RUNGS
from ..film_scene import FilmScene
from ..units import Measured

FLUID = {"barus": 0.0, "density": "constant"}  # effects that are keys of the table [fluid], and their values without effect


class EffectTable(Measured):
    """Data of one effect."""

    def effect(self, scene: Any) -> Effect:
        """What it does to the film of the scene."""
        raise NotImplementedError


if TYPE_CHECKING:

    class WithEffects(FilmScene):
        """A scene that may have a table for each effect."""

        temperature: Any = None
else:  # whatever the registry has, lines from outside among them
    WithEffects = create_model(
        "WithEffects",
        __base__=FilmScene,
        **{
            name: (entry.load() | None, Field(None, description=entry.line))
            for name, entry in RUNGS.items()
            if name not in FLUID
        },
    )


def named(scene: Any) -> list[str]:
    """The effects that a scene has data for, in the registry's order."""
    fluid = getattr(scene, "fluid", None)
    return [
        name
        for name in RUNGS
        if (getattr(fluid, name, FLUID[name]) != FLUID[name] if name in FLUID else getattr(scene, name, None) is not None)
    ]


def without(scene: Any, names: Iterable[str]) -> Any:
    """The scene without these effects; the viscosity stays that of T_in where it followed from the temperature's data."""
    names = set(names)
    changes: dict[str, Any] = {name: None for name in names if name not in FLUID}
    if "temperature" in names:
        changes |= scene.isothermal()
    if of_fluid := {name: FLUID[name] for name in names & set(FLUID)}:
        changes["fluid"] = changes.get("fluid", scene.fluid).model_copy(update=of_fluid)
    return scene.model_copy(update=changes)


def effects_of(scene: Any) -> tuple[Effect, ...]:
    """What the scene's tables do to its film, in the registry's order."""
    return tuple(getattr(scene, name).effect(scene) for name in named(scene) if name not in FLUID)


def check_names(names: Iterable[str]) -> None:
    """Refuse a name that is no effect's.

    Raises
    ------
    InputError : with the nearest one.
    """
    for name in names:
        if name not in RUNGS:
            raise InputError(
                f"--model {name}: allowed are auto, full, least, or names of {', '.join(RUNGS)}{nearest(name, RUNGS)}"
            )
