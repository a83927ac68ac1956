"""What can be said of a discrete problem before it is built: enough to choose how to solve it, and whether it fits."""

from dataclasses import dataclass
from math import prod


@dataclass(frozen=True)
class Facts:
    """A problem in numbers.

    Attributes
    ----------
    kind : which methods apply (`Problem.kind`).
    shape : numbers of points, (nx,) or (nx, ny).
    ranks : that share them.
    periodic : whether the domain closes in x, and in y.
    dense : whether the Jacobian is a dense matrix.
    held : whether supplies hold cells inside at their pressures.
    moving : whether cells store liquid: a time step. free : whether what moves answers to the film by its stiffness.
    alike : whether all lines along x have the same film and width: what it drags is stored once.
    twice : whether a film is solved once more, with faces made for its cavities.
    spread : points of the whole film whose fields a part's answer becomes; 0: it is the whole one.
    lent : whether a part's coefficients lie in the whole's memory.
    """

    kind: str
    shape: tuple[int, ...]
    ranks: int = 1
    periodic: tuple[bool, ...] = (False, False)
    dense: bool = False
    held: bool = False
    moving: bool = False
    free: bool = False
    alike: bool = False
    twice: bool = False
    spread: int = 0
    lent: bool = False

    @property
    def dim(self) -> int:
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of points."""
        return prod(self.shape)

    @property
    def whole_lines(self) -> bool:
        """Whether every rank owns whole lines of the direction of flow (`Grid` deals them out so where there are enough)."""
        return self.dim == 2 and self.shape[1] >= self.ranks
