"""Tables of a scene file that name an effect's data: one file and one line in the registry (RUNGS) each.

A table makes an `Effect` (problems/film/effects). Barus' viscosity and the density's dependence on pressure stand among the
keys of the fluid; they are effects by name as well, and can be left out like the others.
"""

from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field, create_model, model_validator

from ...problems.film.effects import Effect
from ...registry import RUNGS
from ..film_scene import FilmScene
from ..units import Measured
from .named import FLUID


class EffectTable(Measured, Effect):
    """Data of one effect, which it is itself unless `effect` makes one of them. hint : what else may be meant by its name."""

    hint: ClassVar[str] = ""

    @model_validator(mode="before")
    @classmethod
    def _table(cls, data: Any) -> Any:
        if isinstance(data, (int, float, str)):
            raise ValueError(f"a table is needed{cls.hint}")
        return data

    def effect(self, scene: Any) -> Effect:
        """What it does to the film of the scene."""
        return self


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
