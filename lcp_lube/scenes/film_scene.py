"""What all families of films share: one model, from which problem and facts are made, and numbers beyond the film's own."""

from typing import Any

from petsc4py import PETSc

from ..problems.facts import Facts
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from .scene import Scene


class FilmScene(Scene):
    """A scene that is a film; a family says which, in `model`."""

    @property
    def model(self) -> Model:
        """What is discretised."""
        raise NotImplementedError

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.model.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The discrete problem on this scene's grid. Collective.

        Raises
        ------
        InputError : more ranks than the grid can be dealt to, a film that is not positive.
        """
        return self.model.build(self.shape, comm)


class BearingNumbers(FilmScene):
    """A film whose bearing has numbers of its own."""

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = super().build(comm)
        problem.extras = self.bearing_numbers
        return problem

    def bearing_numbers(self, values: dict[str, Any]) -> dict[str, Any]:
        """Made of the film's: what they add to these, or take the place of."""
        raise NotImplementedError
