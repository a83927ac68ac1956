"""Whether the lines of points beside a scene are its own, moved with the film's edges, or others between them."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.lines import some_places
from ...problems.film.model import Model
from .equations import knots

OTHERWISE = 0.1  # of a mean spacing
PARTED = "no derivative on this grid: edges that share a line of points part"


class Laid:
    """A film's lines of points on a grid of this shape, which are looked for once."""

    def __init__(self, model: Model, shape: Sequence[int]):
        self.model, self.shape = model, tuple(shape)

    @cached_property
    def _edges(self) -> Any:
        return self.model.edges

    @cached_property
    def _own(self) -> list[tuple[Array | None, Array]]:
        """Of each side the lines, None where they are even, and the edges that they follow."""
        ends = [knots(self.model, k, kinds[0] == "periodic") for k, (_, kinds, _) in enumerate(self._edges)]
        return list(zip(self.model.lines(self.shape), ends, strict=False))

    def anew(self, other: Model) -> bool:
        """Whether lines do not go with the edges to a film near by, but are others between them.

        Raises
        ------
        InputError : edges came or went.
        """
        edges = other.edges
        if self._edges == edges:
            return False
        lines = other.lines(self.shape, [own != one for own, one in zip(self._edges, edges, strict=True)])
        for k, (n, (here, before), there) in enumerate(zip(self.shape, self._own, lines, strict=False)):
            if self._edges[k] == edges[k] or (here is None and there is None):
                continue
            (L, kinds, _), (length, *_) = self._edges[k], edges[k]
            at, to = (some_places(n, a, kinds, n) if lines is None else lines for a, lines in ((L, here), (length, there)))
            after = knots(other, k, kinds[0] == "periodic")
            if before.size != after.size:
                raise InputError(PARTED)
            at = np.interp(at, before, after)
            if np.abs(to - at).max() * n > OTHERWISE * length:
                return True
        return False
