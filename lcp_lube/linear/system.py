"""What a method asks of a linear system, whichever matrix stands behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from petsc4py import PETSc

from ..base.owned import Owned
from ..base.parallel import Array
from ..base.stages import Stages
from ..registry import SYSTEMS
from .krylov import Krylov

if TYPE_CHECKING:
    from ..problems.film.lubrication import LubricationProblem


class System:
    """Solves A dp + B dr = f1, D_p dp + D_r dr = f2 with diagonal D_p, D_r."""

    krylov: Krylov = None  # type: ignore[assignment]  # until there is a matrix

    def __init__(self, problem: LubricationProblem, stages: Stages | None = None):
        self.problem, self.stages = problem, stages or Stages()
        self._own = Owned(self, problem.grid.petsc_comm)

    @property
    def direct(self) -> bool:
        """Whether the inner solves are direct: then the forcing term is zero."""
        return self.krylov is not None and self.krylov.direct

    def solve(self, D_p: Array, D_r: Array, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """dp, dr and the number of linear iterations. Collective.

        Raises
        ------
        LinearSolverError : breakdown, a failed factorisation, or a result that is not finite.
        """
        raise NotImplementedError

    def resolve(self, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """The same for other right-hand sides with the matrix of the last `solve`: no factorisation again. Collective."""
        raise NotImplementedError

    def destroy(self) -> None:
        """Free the PETSc objects; a python PC must not outlive this."""
        if self.krylov is not None:
            self.krylov.destroy()
        self._own.free()


class OneMatrix(System):
    """A matrix whose values change, two vectors and its KSP; python preconditioners find `problem` as its attribute."""

    def __init__(self, problem: Any, stages: Stages, mat: PETSc.Mat):
        super().__init__(problem, stages)
        self.mat = self._own(mat)
        self.mat.setAttr("problem", problem)
        self.x, self.b = map(self._own, mat.createVecs())
        self.krylov = Krylov(mat)


def make_system(name: str, problem: LubricationProblem, stages: Stages) -> System:
    """The system that the registry knows by this name, for one problem."""
    return SYSTEMS[name].load()(problem, stages)
