"""The outer loop of every method: step, test, record. A method supplies the step; the loop owns limits and outcomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..linear.krylov import LinearSolverError
from ..problems.solution import Outcome, Step
from .method import Method
from .steplength import StepLengthError


class NoSolutionError(ArithmeticError):
    """The problem has no solution, as the method has found; the message says how it knows."""


class StalledError(ArithmeticError):
    """The method goes on without getting anywhere; the message says how it knows, and which option sets its patience."""


@dataclass(frozen=True)
class Stopping:
    """Stop when ||F|| <= eps1 and ||alpha d|| <= eps2, or by the method's own rule (`Step.enough`); at most max_it steps."""

    eps1: float = 1e-8
    eps2: float = 1e-8
    max_it: int = 500


Monitor = Callable[[int, Step], None]


def iterate(
    method: Method, stopping: Stopping, monitor: Monitor | None = None, before: Sequence[Step] = ()
) -> tuple[Outcome, str, list[Step]]:
    """Run a method to its end. Collective.

    Parameters
    ----------
    before : the steps that a run has made which is taken up again; they count as its own.

    Returns
    -------
    outcome : CONVERGED means here only that the stopping test held; the caller adds the certificate.
    message : why it ended, as a sentence.
    steps : one record a step.
    """
    steps = list(before)
    if not steps and not np.isfinite(method.norm):
        return Outcome.NOT_FINITE, "||F|| at the starting vector is not finite", steps
    if steps and (end := _end(len(steps), steps[-1], stopping)):
        return *end, steps
    for k in range(len(steps) + 1, stopping.max_it + 1):
        try:
            step = method.advance()
        except StepLengthError as error:
            return Outcome.STEP_LENGTH, f"step {k}: no acceptable step length, {error}", steps
        except StalledError as error:
            return Outcome.STALLED, f"step {k}: {error}", steps
        except LinearSolverError as error:
            return Outcome.LINEAR_SOLVER, f"step {k}: {error}", steps
        except NoSolutionError as error:
            return Outcome.NO_SOLUTION, f"step {k}: {error}", steps
        steps.append(step)
        if monitor is not None:
            monitor(k, step)
        if end := _end(k, step, stopping):
            return *end, steps
    last = f" with ||F|| = {steps[-1].norm:.2e}, ||alpha d|| = {steps[-1].step_norm:.2e}" if steps else ""
    return Outcome.MAX_ITERATIONS, f"not converged after {stopping.max_it} iterations{last}", steps


def _end(k: int, step: Step, stopping: Stopping) -> tuple[Outcome, str] | None:
    """How the run ends with this step; None if it goes on."""
    if not (np.isfinite(step.norm) and np.isfinite(step.step_norm)):
        return Outcome.NOT_FINITE, f"step {k}: ||F|| = {step.norm}, ||alpha d|| = {step.step_norm}"
    if step.enough or (step.norm <= stopping.eps1 and step.step_norm <= stopping.eps2):
        return Outcome.CONVERGED, f"||F|| = {step.norm:.2e}, ||alpha d|| = {step.step_norm:.2e}"
    return None
