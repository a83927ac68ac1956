"""One thing of each kind from outside: a file, and a line in `register`, which an entry point names."""

from typing import Literal

from lcp_lube.registry import Entry, MethodEntry


def register(registry):
    """What the entry point names."""
    registry.METHODS["toy-method"] = MethodEntry("toys:build", "a toy: the active set under another name", systems=("reduced",))
    registry.SHAPES["toy-shape"] = Entry("toys:toy_shape", "a toy: a film of constant height")
    registry.FAMILIES["toy-family"] = Entry("toys:toy_family", "a toy: problem 1 with a film twice as thick")
    registry.STABILITY["toy-map"] = Entry("toys:chart", "a toy: a map that draws nothing")
    registry.RUNGS["toy_liner"] = Entry("toy_liner:ToyLiner", "a toy: a wall that gives way")
    registry.DRIVERS = {"toy-driver": Entry("toys", "a toy: leaves a note"), **registry.DRIVERS}


def build(job):
    from lcp_lube.solvers.active_set import ActiveSet

    return ActiveSet(job)


def __getattr__(name):  # models are made when they are asked for: naming costs no PETSc
    if name == "toy_shape":
        from lcp_lube.problems.film.shapes import Block
        from lcp_lube.scenes.film import Part
        from lcp_lube.scenes.units import metres

        class ToyShape(Part):
            """A film of constant height."""

            shape: Literal["toy-shape"]
            h: float = metres(..., "height")

            def part(self, extent):
                return Block(self.h, (-1.0, 1.0), (-1.0, 1.0))

        return ToyShape
    if name == "toy_family":
        from lcp_lube.scenes.published import SliderScene

        class ToyScene(SliderScene):
            """Problem 1 with a film twice as thick."""

            family: Literal["toy-family"] = "toy-family"
            h_min: float = 30e-6
            h_max: float = 50e-6

        return ToyScene
    raise AttributeError(name)


def chart(quick, results):
    from lcp_lube.output.console import say

    say("the toy's map")
    return 0


def applies(scene, ask):
    return not getattr(scene, "toy", False)


def solve(scene, ask, inner):
    solution = inner(scene, ask)
    solution.settings["why"] = ["the toy driver was here", *solution.settings["why"]]
    return solution
