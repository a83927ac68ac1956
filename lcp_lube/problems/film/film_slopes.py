"""Derivatives of the box scheme's coefficients by the film: a complex step through the code that makes them."""

from typing import Any

import numpy as np

from .lubrication import LubricationProblem
from .reynolds import BoxScheme, Film, _coefficients
from .views import Raised

STEP = 1e-30  # relative: nothing is subtracted, so no digits are lost however small it is


def film_slopes(problem: LubricationProblem, film: Film, data: dict[str, Any]) -> BoxScheme:
    """Derivatives of a problem's coefficients by the film, everywhere at once: by a complex step through the same code.

    A coefficient depends on the film at its own face or point alone (`mean_cubes`: at both points; `integrals`: between its
    two points), so each has its own derivative; h has 1.

    Parameters
    ----------
    data : what `box_scheme` is told beside grid and film.
    """
    grid, flow_unit = problem.grid, problem.scheme.flow_unit
    step = STEP * grid.reduce.max(np.abs(np.asarray(film(grid.x, grid.y))))
    moved: Any = Raised(film, 1j * step)
    integrals = None if problem.integrals is None else problem.integrals.lifted(1j * step)
    names = ("mu", "U", "scheme", "p_sides", "p_unit", "mean_cubes", "r_in")
    box = _coefficients(grid, moved, *(data[name] for name in names), problem.dry, integrals)  # type: ignore[arg-type, call-arg]
    changes = {name: np.imag(getattr(box, name)) / step for name in box.arrays}
    return BoxScheme(**{name: a if name == "h" else a / flow_unit for name, a in changes.items()}, flow_unit=flow_unit)
