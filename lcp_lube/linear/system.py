"""What a method asks of a linear system, whichever matrix stands behind it."""

from typing import Protocol

from ..base.parallel import Array
from ..base.stages import Stages
from ..problems.film.lubrication import LubricationProblem
from ..registry import SYSTEMS
from .krylov import Krylov


class System(Protocol):
    """Solves A dp + B dr = f1, D_p dp + D_r dr = f2 with diagonal D_p, D_r."""

    stages: Stages
    krylov: Krylov

    @property
    def direct(self) -> bool:
        """Whether the inner solves are direct: then the forcing term is zero."""
        ...

    def solve(self, D_p: Array, D_r: Array, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """dp, dr and the number of linear iterations. Collective."""
        ...

    def resolve(self, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """The same for other right-hand sides with the matrix of the last `solve`. Collective."""
        ...

    def destroy(self) -> None: ...


def make_system(name: str, problem: LubricationProblem, stages: Stages) -> System:
    """The system that the registry knows by this name, for one problem."""
    return SYSTEMS[name].load()(problem, stages)
