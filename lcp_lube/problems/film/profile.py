"""A measured film: a table of heights from a file, checked when it is read, interpolated between its points."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from .surface import METROLOGY, TIF, metrology, tif_heights

SHORT = 0.05  # of the pad, at most
SLACK = 1.01  # of the largest step: a profile may end so much before the pad
METHODS = {"linear": 2, "cubic": 4, "nearest": 1}  # and the points that each needs along a side


@dataclass(frozen=True)
class Profile:
    """Heights z (m) on the lines x (m) and y (m) of a rectangular lattice, z[j, i] at x[i], y[j]; y = [0] in 1D."""

    x: Array
    y: Array
    z: Array
    method: str

    @cached_property
    def _values(self) -> Callable[[Array, Array], Array]:
        """z at points y and x."""
        from scipy.interpolate import CubicSpline, RectBivariateSpline, RegularGridInterpolator  # here: it takes a while

        if self.y.size == 1:
            if self.method == "cubic":
                spline = CubicSpline(self.x, self.z[0])
                return lambda y, x: spline(x)
            line = RegularGridInterpolator((self.x,), self.z[0], method=self.method)
            return lambda y, x: line(x[..., None])
        if self.method == "cubic":
            return RectBivariateSpline(self.y, self.x, self.z, kx=3, ky=3, s=0).ev
        plane = RegularGridInterpolator((self.y, self.x), self.z, method=self.method)
        return lambda y, x: plane(np.stack([y, x], axis=-1))

    def __call__(self, x: Array, y: Array) -> Array:
        """h (m) at x and y (m), which broadcast; beyond the profile its value at the edge."""
        x, y = np.broadcast_arrays(np.clip(x, self.x[0], self.x[-1]), np.clip(y, self.y[0], self.y[-1]))
        return self._values(y, x)


class PiecewiseLinear(Profile):
    """A profile in 1D whose kinks are its points: an exact solution can be had."""

    def breakpoints(self) -> tuple[float, ...]:
        return tuple(self.x)


def read_profile(
    path: Path, lengths: tuple[float, ...], method: str, height_unit: float, length_unit: float, uneven: bool = False
) -> Profile:
    """A profile over [0, L] or [0, L] x [0, Ly].

    Parameters
    ----------
    path : .csv with rows x, h (1D, or 2D where h does not depend on y) or x, y, h in any order, or .npy with h at
        equidistant points from side to side: (nx,) or (ny, nx), or such points as the grey values of a .tif; or a surface in
        one of the formats of `surface.METROLOGY`, with its own units. A .csv may have comments (#) and one head line.
    method : 'linear', 'cubic' or 'nearest'.
    height_unit, length_unit : metres in the file's unit of h, and of x and y (.csv).
    uneven : the x of a .csv may lie at uneven distances.

    Raises
    ------
    InputError : an unreadable file, a missing row or value, a value that is no number, a profile that does not reach the sides.
    """
    try:
        suffix = path.suffix.lower()
        if suffix == ".npy" or suffix in TIF:
            x, y, z = _from_array(path, lengths)
        elif suffix == ".csv":
            x, y, z = _from_rows(path, length_unit, uneven)
        elif suffix in METROLOGY:
            x, y, z = metrology(path)
            height_unit = 1.0
            if len(lengths) == 1:
                raise InputError(f"profile {path}: a surface h(x, y); a scene of dimension = 2 is needed")
        else:
            raise InputError(f"profile {path}: allowed are {', '.join(('.csv', '.npy', *TIF, *METROLOGY))}")
    except OSError as error:
        raise InputError(f"profile {path}: {error.strerror or error}") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"profile {path}: {error}") from None  # a name that no file can have
    if not np.isfinite(z).all():
        j, i = np.argwhere(~np.isfinite(z))[0]
        raise InputError(f"profile {path}: h is {z[j, i]} at x = {x[i]:g}, y = {y[j]:g} m")
    for name, line, length in zip("xy", (x, y), lengths, strict=False):
        # Rounded coordinates, or a step rounded and added up: an end may lie a point and some digits short.
        slack = max(1e-6, min(SLACK * float(np.max(np.diff(line))) / length, SHORT)) * length if line.size > 1 else 0.0
        if line.size > 1 and not (line[0] <= slack and line[-1] >= length - slack):
            raise InputError(f"profile {path}: {name} from {line[0]:g} to {line[-1]:g} m; 0 to {length:g} m is needed")
        if 1 < line.size < METHODS[method]:
            raise InputError(f"profile {path}: {line.size} points in {name}; {method} interpolation needs {METHODS[method]}")
    kind = PiecewiseLinear if y.size == 1 and method == "linear" else Profile
    return kind(x, y, z * height_unit, method)


def _from_array(path: Path, lengths: tuple[float, ...]) -> tuple[Array, Array, Array]:
    try:
        z = tif_heights(path) if path.suffix.lower() in TIF else np.load(path, allow_pickle=False)
    except InputError:
        raise
    except ValueError:
        raise InputError(f"profile {path}: no array of numbers in NumPy's format") from None
    if not (isinstance(z, np.ndarray) and z.ndim in (1, 2) and z.ndim <= len(lengths) and min(z.shape) > 1):
        raise InputError(f"profile {path}: shape {getattr(z, 'shape', None)}; (nx,) or, in 2D, (ny, nx) is needed, 2 and more")
    if z.dtype.kind not in "fiu":
        raise InputError(f"profile {path}: entries of type {z.dtype}; numbers are needed")
    z = np.atleast_2d(z.astype(float))
    x = np.linspace(0.0, lengths[0], z.shape[1])
    return x, np.linspace(0.0, lengths[1], z.shape[0]) if z.shape[0] > 1 else np.zeros(1), z


def _from_rows(path: Path, unit: float, uneven: bool) -> tuple[Array, Array, Array]:
    rows: list[list[float]] = []
    columns = 0
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"profile {path}: not a text file") from None
    last = max((k for k, line in enumerate(lines) if line.strip()), default=-1)
    for number, line in enumerate(lines[: last + 1], start=1):
        if line.lstrip().startswith("#"):
            continue
        words = [word.strip() for word in line.replace(";", ",").split(",")]
        try:
            row = [float(word) for word in words]
        except ValueError:
            if not rows and not columns and all(words):
                columns = len(words)  # the head line
                continue
            raise InputError(f"profile {path}, line {number}: {line.strip()[:40]!r}: a row of numbers is missing") from None
        columns = columns or len(row)
        if len(row) != columns or columns not in (2, 3):
            raise InputError(f"profile {path}, line {number}: {len(row)} values; x, h or x, y, h are needed in every row")
        if not np.isfinite(row).all():
            raise InputError(f"profile {path}, line {number}: {line.strip()[:40]!r}: a value is no finite number")
        rows.append(row)
    if len(rows) < 2:
        raise InputError(f"profile {path}: {len(rows)} rows; 2 and more are needed")
    table = np.array(rows)
    x, at_x = np.unique(table[:, 0] * unit, return_inverse=True)
    y, at_y = np.unique(table[:, 1] * unit, return_inverse=True) if columns == 3 else (np.zeros(1), np.zeros(len(rows), int))
    z = np.full((y.size, x.size), np.nan)
    z[at_y, at_x] = table[:, -1]
    if len(rows) > z.size:
        raise InputError(f"profile {path}: {len(rows)} rows for {z.size} points: some points are there twice")
    if np.isnan(z).any():
        j, i = np.argwhere(np.isnan(z))[0]
        raise InputError(f"profile {path}: the row for x = {x[i] / unit:g}, y = {y[j] / unit:g} is missing")
    for name, line in (("x", x), ("y", y)):
        _check_even(path, name, line / unit, uneven)
    return x, y, z


def _check_even(path: Path, name: str, line: Array, uneven: bool) -> None:
    """Almost all distances equal and some of them doubled or more: rows are missing."""
    steps = np.diff(line)
    if uneven or steps.size < 5:
        return
    in_steps = steps / np.median(steps)
    gaps = np.flatnonzero((in_steps > 1.5) & (np.abs(in_steps - np.rint(in_steps)) < 0.02))
    if gaps.size and np.mean(np.abs(in_steps - 1.0) < 0.01) > 0.7:
        after = line[gaps[0]]
        raise InputError(f"profile {path}: a row is missing after {name} = {after:g} (uneven = true if that is meant)")
