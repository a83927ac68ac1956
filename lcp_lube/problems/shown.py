"""What a solution shows of itself: numbers, fields in SI, units, and by way of the registry its record, pictures and files."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.parallel import Array, overflow_is_no_warning
from ..errors import InputError, nearest
from ..registry import OUTPUT
from .frame import Frame

if TYPE_CHECKING:
    from .solution import Fields, Problem


class Shown:
    """The user's half of a `Solution`: everything here follows from its problem, fields and record."""

    problem: "Problem"
    fields: "Fields"
    told_by: Any

    @cached_property
    @overflow_is_no_warning
    def numbers(self) -> dict[str, Any]:
        """`Problem.quantities` of the fields; taken once. Collective the first time, which `solve` sees to on several ranks.

        Of a run to an accuracy the number asked for is the best value, that of all grids.
        """
        found = self.problem.quantities(self.fields)
        return found if self.told_by is None else self.told_by.tell(self, found)

    @property
    def estimates(self) -> dict[str, dict[str, Any]]:
        """Of a run to an accuracy: value, error (in its unit) and extrapolated of every number. Collective as `numbers`."""
        return self.told_by.estimates if self.told_by is not None and self.numbers else {}

    @property
    def quantities(self) -> dict[str, Any]:
        """The dictionary that --json prints: all numbers and the record of the run, SI units (`units`)."""
        return OUTPUT["record"].load()(self)

    @property
    def units(self) -> dict[str, str]:
        """Units of the numbers and of the fields, by name; empty for what has none."""
        of_fields = {name: unit for name, (_, unit) in self._physical.items()}
        length = "m" if any(of_fields.values()) else ""
        return {**dict.fromkeys(self.numbers, ""), **self.problem.units, **of_fields, "x": length, "y": length}

    def field(self, name: str, boundary: bool = False) -> Array:
        """A field, or the coordinates 'x', 'y', in SI: shape (ny, nx), or (nx,) in 1D. On several ranks: the rank's own part.

        Parameters
        ----------
        boundary : with the points of the sides: (ny + 2, nx + 2), or (nx + 2,).

        Raises
        ------
        InputError : no such field; no sides.
        """
        grid = self.problem.grid
        names = [*self._physical, *"xy"[: grid.dim]]
        if name not in names:
            raise InputError(f"no field {name}{nearest(name, names)}; there are {', '.join(names)}")
        frame = Frame(grid) if boundary else None
        points = frame or grid
        if name in "xy":
            values = np.broadcast_to(points.x if name == "x" else points.y, points.box)
        else:
            values = self._physical[name][0].reshape(grid.box)
            if frame is not None:
                known = self.problem.at_sides(name, frame.x, frame.y)
                if known is None:
                    raise InputError(f"{name}: this problem has no points on a boundary")
                values = frame.fill(values, known)
        return values if grid.dim == 2 else values[0]

    @property
    def _physical(self) -> dict[str, tuple[Array, str]]:
        return self.problem.physical(self.fields)

    def __getattr__(self, name: str) -> Any:
        # Asked only for what is neither an attribute nor a method.
        if name.startswith("_") or "problem" not in self.__dict__:
            raise AttributeError(name)
        if name in self.numbers:
            return self.numbers[name]
        fields = [*self._physical, *"xy"[: self.problem.grid.dim]]
        if name in fields:
            return self.field(name)
        if name in (record := self.quantities):
            return record[name]
        raise AttributeError(f"a solution of this problem has no {name}{nearest(name, [*record, *fields])}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.quantities, *self._physical, *"xy"[: self.problem.grid.dim]})

    def __repr__(self) -> str:
        return OUTPUT["summary"].load()(self.quantities).partition("\n")[0]

    def plot(self, path: str | Path) -> None:
        """Draw the solution to a .png, .pdf or .svg. Collective.

        Raises
        ------
        InputError : another extension, matplotlib is missing, or the file cannot be written.
        """
        OUTPUT["plot"].load()(self, path)

    def save(self, path: str | Path, boundary: bool = False) -> None:
        """Write the fields to a .npz, .nc, .vts, .vtr, .pvd or .h5; boundary: with the points of the sides. Collective.

        Raises
        ------
        InputError : another extension, or the file cannot be written.
        """
        OUTPUT["save"].load()(self, path, boundary)

    def front_curves(self) -> list[Array]:
        """x and y (m) along the fronts of a plane film's cavities, shape (points, 2); on rank 0. Collective.

        Raises
        ------
        InputError : no film in the plane.
        """
        from .film.front_curves import front_curves

        return front_curves(self.problem, self.fields["p"], self.fields["r"])  # type: ignore[arg-type]

    def gradient(self, quantity: str = "load", keys: str | Sequence[str] | None = None) -> dict[str, float]:
        """Derivatives of one of the numbers by numbers of the scene, SI: dQ/da by key, as --set takes them. Collective.

        One transposed solve for the quantity, whatever the number of keys (docs/gradients.md).

        Parameters
        ----------
        keys : one key, or several; default all that have a derivative.

        Raises
        ------
        InputError : a quantity or a key without a derivative, a solution that did not converge.
        """
        return OUTPUT["gradient"].load()(self, quantity, keys)

    def film_gradient(self, quantity: str = "load") -> Array:
        """The derivative of one of the numbers by the film at every point, dQ/dh(x, y), through effects too. Collective.

        An array as the fields are, in the number's unit per m and m2 (1D: per m and m): a film changed by dh(x, y) changes the
        number by the integral of dQ/dh dh. Where it is negative, taking material away there lowers the number.

        Raises
        ------
        InputError : a quantity without a derivative, no film, or one in time, a solution that did not converge.
        """
        return OUTPUT["film_gradient"].load()(self, quantity)

    def coefficients(self, frequency: float | Sequence[float] = 0.0, tilt: bool = False) -> Any:
        """Stiffness and damping: `K`, `C` and their `motions`, SI (`drivers.coefficients`). Collective.

        Parameters
        ----------
        frequency : of the motion, rad/s; of several there is a list. tilt : with the slopes of a journal's axis, 4 x 4.

        Raises
        ------
        InputError : no film, or one in time, a frequency below zero, a solution that did not converge.
        NotFound : effects whose linearised equations GMRES does not solve.
        """
        return OUTPUT["coefficients"].load()(self, frequency, tilt)

    def to_xarray(self, boundary: bool = False) -> Any:
        """The fields as an xarray.Dataset with their units, over x and y. On several ranks: the rank's own part.

        Raises
        ------
        InputError : xarray is missing.
        """
        return OUTPUT["xarray"].load()(self, boundary)
