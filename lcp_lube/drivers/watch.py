"""What `Ask.progress` is told while a method works on a grid."""

from ..base.progress import decades
from ..problems.solution import Problem, Step
from ..solvers.newton import Monitor, Stopping
from .ask import Ask


def watching(ask: Ask, level: Problem, whole: Problem, stopping: Stopping) -> Monitor | None:
    """The caller's monitor, and what is told: the grid, and how far ||F|| has come down on it.

    Parameters
    ----------
    level, whole : the problem on this grid and on the finest: coarser grids take a part of the time.
    """
    if ask.progress is None:
        return ask.monitor
    name, share = " x ".join(map(str, level.grid.shape)), level.grid.size / whole.grid.size
    norms: list[float] = []

    def watch(k: int, step: Step) -> None:
        if ask.monitor is not None:
            ask.monitor(k, step)
        norms.append(step.norm)
        ask.tell(
            "grids", f"grid {name}, step {k}, ||F|| {step.norm:.1e}", share * decades(max(norms), step.norm, stopping.eps1)
        )

    return watch
