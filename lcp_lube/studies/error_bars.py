"""Error bars: what tolerances of a scene's numbers make of a result, to first order and by solving for samples of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..api import solve
from ..base.quantity import in_si
from ..drivers.ask import Ask
from ..drivers.derivatives.adjoint import Adjoint
from ..drivers.derivatives.gradient import Gradient
from ..drivers.derivatives.march_gradient import means
from ..errors import InputError
from ..problems.solution import Solution
from ..scenes.changes import flat
from ..scenes.moving import motion_of
from ..scenes.scene import Scene
from ..scenes.values import key_of, unit_of, values_of, with_values

LEVEL = "h"  # stands for the level of the whole film


@dataclass(frozen=True)
class Samples:
    """What solves for samples gave: mean and standard deviation by quantity; failed ones are left out.

    error : of the standard deviation itself, relative, 1/sqrt(2 (N - 1)).
    """

    mean: dict[str, float]
    deviation: dict[str, float]
    solved: int
    failed: int

    @property
    def error(self) -> float:
        return 1.0 / np.sqrt(2.0 * max(self.solved - 1, 1))


def deviations(scene: Scene, tolerances: Mapping[str, Any]) -> dict[str, float]:
    """Standard deviations in SI by key, from texts such as '1um', '5%' (of the value) or numbers in SI.

    Raises InputError for a key that is no number of the scene, a text that is none, a deviation that is not positive.
    """
    values, out = values_of(scene), {}
    for text, given in flat(tolerances).items():
        if text == LEVEL and "h" not in values:
            if "h_offset" not in values:
                raise InputError(
                    f"--tolerance {text}: scene {scene.name} has no h_offset, the film's level; name one of its numbers"
                )
            key = "h_offset"
        else:
            key = key_of(scene, text)
        try:
            relative = str(given).strip().endswith("%")
            size = in_si(str(given), "" if relative else unit_of(scene, key))
        except InputError as error:
            raise InputError(f"--tolerance {text}={given}: {error}") from None
        if size is None:
            raise InputError(f"--tolerance {text}={given}: a number, or a per cent of the value, is needed")
        size = abs(values[key]) * size if relative else size
        if not (np.isfinite(size) and size > 0):
            what = f"{values[key]:g} is the value" if relative else "more than 0 is needed"
            raise InputError(f"--tolerance {text}={given}: {what}")
        out[key] = float(size)
    return out


def first_order(gradient: Gradient, deviation: Mapping[str, float]) -> tuple[float, dict[str, float]]:
    """Standard deviation of a quantity whose numbers vary independently: root of the sum of (dQ/da u_a)^2, and these terms.

    Raises InputError for a number without a derivative.
    """
    for key in deviation:
        if key not in gradient.gradient:
            raise InputError(f"--tolerance {key}: no derivative: {gradient.held.get(key, 'it is no number of the film')}")
    parts = {key: abs(gradient.gradient[key]) * u for key, u in deviation.items()}
    return float(np.sqrt(sum(part**2 for part in parts.values()))), parts


def monte_carlo(
    scene: Scene, near: Solution, quantities: Sequence[str], deviation: Mapping[str, float], count: int, seed: int, ask: Ask
) -> Samples:
    """Solve for normally distributed numbers, each sample started from the answer in the middle. Collective.

    Raises InputError for fewer than two samples, asked for or solved.
    """
    if count < 2:
        raise InputError(f"--monte-carlo {count}: at least 2 samples are needed")
    draws = np.random.default_rng(seed).standard_normal((count, len(deviation)))
    values = values_of(scene)
    rows: list[list[float]] = []
    for k, draw in enumerate(draws):
        ask.tell("sweep", f"sample {k + 1} of {count}", k / count)
        changed = {key: values[key] + u * float(x) for (key, u), x in zip(deviation.items(), draw, strict=True)}
        try:
            at = with_values(scene, changed)
            with solve(at, ask, start=near if motion_of(scene) is None else None) as solution:
                if solution.converged:
                    rows.append(numbers(at, solution, quantities))
        except InputError:
            pass  # a sample outside of what is allowed: counted as failed
    if len(rows) < 2:
        raise InputError(f"--monte-carlo {count}: {len(rows)} samples could be solved; smaller tolerances are needed")
    table = np.array(rows)
    mean, spread = table.mean(axis=0), table.std(axis=0, ddof=1)
    by_name = [dict(zip(quantities, map(float, row), strict=True)) for row in (mean, spread)]
    return Samples(by_name[0], by_name[1], len(rows), count - len(rows))


def numbers(scene: Scene, solution: Solution, quantities: Sequence[str]) -> list[float]:
    """Values of quantities as `gradients` has them. Collective."""
    known = {**solution.numbers, **means(solution.history)}
    if all(isinstance(known.get(name), float) for name in quantities):
        return [known[name] for name in quantities]
    adjoint = Adjoint(scene, solution, [])
    try:
        report = adjoint.equations.report(adjoint.numbers)
        return [adjoint.value(name) if name in adjoint.found else report[name] for name in quantities]
    finally:
        adjoint.destroy()
