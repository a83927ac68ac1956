"""Measured surfaces in files of other programs: .tif heights, and the formats of surface metrology by surfalize."""

from pathlib import Path

import numpy as np

from ...base.parallel import Array
from ...errors import InputError

TIF = (".tif", ".tiff")
# Of surfalize's readers: the exchange formats (ISO 25178-72 and -71, SURF) and those of makers of profilometers.
METROLOGY = (".x3p", ".sdf", ".sur", ".al3d", ".opd", ".plu", ".plux", ".vk4", ".vk6", ".vk7", ".zmg", ".tmd", ".gwy", ".nms")
MICROMETRE = 1e-6

Table = tuple[Array, Array, Array]  # x (m), y (m), heights


def tif_heights(path: Path) -> Array:
    """Grey values of a picture of one channel, shape (ny, nx), its first row at y = 0.

    Raises
    ------
    InputError : tifffile is missing, no picture, or one of several channels.
    """
    try:
        import tifffile
    except ImportError:
        raise InputError(f"profile {path}: .tif files need tifffile: pip install lcp-lube[surface]") from None
    try:
        z = np.asarray(tifffile.imread(path))
    except OSError:
        raise
    except Exception as error:  # whatever the library meets in a damaged file
        raise InputError(f"profile {path}: no picture that tifffile reads ({error})") from None
    if z.ndim != 2:
        raise InputError(f"profile {path}: shape {z.shape}; one channel of heights, (ny, nx), is needed")
    return z


def metrology(path: Path) -> Table:
    """Lines x, y (m) from 0 on in the file's own steps, and heights (m).

    Raises
    ------
    InputError : surfalize is missing, or cannot read the file.
    """
    try:
        from surfalize import Surface
    except ImportError:
        raise InputError(f"profile {path}: {path.suffix} files need surfalize: pip install lcp-lube[surface]") from None
    if not path.is_file():
        raise InputError(f"profile {path}: No such file or directory")
    try:
        surface = Surface.load(path)
        z = np.asarray(surface.data, dtype=float)
        steps = float(surface.step_x), float(surface.step_y)
    except Exception as error:  # whatever the library meets in a damaged file
        raise InputError(f"profile {path}: surfalize cannot read it ({error})") from None
    x, y = (np.arange(n) * step * MICROMETRE for n, step in zip(z.shape[::-1], steps, strict=True))
    return x, y, z * MICROMETRE
