"""The [[film]] tables of a bearing's scene file: named shapes that are added up, each with its parameters."""

from functools import reduce
from math import atan2, hypot, inf, pi, radians
from operator import or_
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from ..errors import InputError
from ..problems.film.profile import read_profile
from ..problems.film.shapes import Along, Block, DimpleArray, Journal, RandomSurface, Shape
from ..problems.film.slanted import Herringbone
from ..problems.film.views import Scaled, Travelling
from ..registry import SHAPES
from .film_scene import Extent
from .formula import Formula
from .scene import Finite
from .units import Measured, metres

Span = tuple[Finite, Finite]
Unit = Literal["m", "mm", "um"]
SLACK = 1e-9  # relative: dimples that touch do not overlap
UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}


class Part(Measured):
    """A shape; its heights in metres are added to the others'."""

    moves: bool = Field(False, description="[motion]: it travels with the wall, going on periodically over the length L")

    def check(self) -> None:
        for name in ("x", "y", "between"):
            span = getattr(self, name, None)
            if span is not None and not span[0] < span[1]:
                raise ValueError(f"{name} = {list(span)}: start < end is needed")

    def part(self, extent: Extent) -> Shape:
        """The shape as a function h(x, y)."""
        raise NotImplementedError

    def placed(self, extent: Extent) -> Shape:
        """The shape where it is at the extent's time."""
        shape = self.part(extent)
        return Travelling(shape, extent.travel, extent.lengths[0]) if self.moves and extent.travel else shape

    @property
    def changes(self) -> bool:
        """Whether it is another one at another time."""
        return self.moves


class Constant(Part):
    """The same height everywhere."""

    shape: Literal["constant"]
    h: Finite = metres(..., "height")

    def part(self, extent: Extent) -> Shape:
        return Block(self.h, (-inf, inf), (-inf, inf))


class Course(Part):
    """A shape that varies along one axis, and keeps its end values beyond `between`."""

    along: Literal["x", "y"] = Field("x", description="axis along which it varies")
    between: Span | None = metres(None, "where it starts and ends on that axis; default from side to side")

    def _course(self, kind: str, h_0: float, h_1: float, extent: Extent, waves: float = 1.0) -> Shape:
        start, end = self.between or (0.0, extent.both[self.along == "y"])
        return Along(kind, h_0, h_1, start, end, self.along, waves)


class Linear(Course):
    """A straight line from h_start to h_end: a wedge."""

    shape: Literal["linear", "wedge"]
    h_start: Finite = metres(..., "height at the start")
    h_end: Finite = metres(..., "height at the end")

    def part(self, extent: Extent) -> Shape:
        return self._course("linear", self.h_start, self.h_end, extent)


class Parabola(Course):
    """A parabola with h_min in the middle and h_max at both ends, or with h_min > h_max the other way round."""

    shape: Literal["parabola"]
    h_min: Finite = metres(..., "height in the middle")
    h_max: Finite = metres(..., "height at both ends")

    def part(self, extent: Extent) -> Shape:
        return self._course("parabola", self.h_min, self.h_max, extent)


class Sinusoid(Course):
    """h_max at the start, then full waves down to h_min and up again."""

    shape: Literal["sinusoid"]
    h_min: Finite = metres(..., "height in the troughs")
    h_max: Finite = metres(..., "height at the start and on the crests")
    waves: Annotated[Finite, Field(gt=0, le=1e4)] = Field(1.0, description="number of full waves")

    def part(self, extent: Extent) -> Shape:
        return self._course("sinusoid", self.h_min, self.h_max, extent, self.waves)


class StepPart(Part):
    """A step: `height` (negative: downwards) from `at` on."""

    shape: Literal["step"]
    height: Finite = metres(..., "height of the step, positive upwards from the start to the end")
    at: Finite = metres(..., "where it is")
    along: Literal["x", "y"] = Field("x", description="axis along which one meets it")

    def part(self, extent: Extent) -> Shape:
        beyond, everywhere = (self.at, inf), (-inf, inf)
        return Block(self.height, *((beyond, everywhere) if self.along == "x" else (everywhere, beyond)))


class Pocket(Part):
    """A rectangular recess (negative depth: a land)."""

    shape: Literal["pocket"]
    depth: Finite = metres(..., "depth")
    x: Span = metres(..., "where it starts and ends in x")
    y: Span | None = metres(None, "where it starts and ends in y; default right across (2D)")

    def part(self, extent: Extent) -> Shape:
        return Block(self.depth, self.x, self.y or (-inf, inf))


class Dimples(Part):
    """An array of equal recesses in the cells of a rectangle."""

    shape: Literal["dimples"]
    depth: Finite = metres(..., "depth")
    size: Annotated[Finite, Field(gt=0)] = metres(..., "diameter, or side of a square one")
    columns: Annotated[int, Field(strict=True, ge=1, le=100_000)] = Field(..., description="dimples along x")
    rows: Annotated[int, Field(strict=True, ge=1, le=100_000)] = Field(1, description="dimples along y (2D)")
    form: Literal["square", "round", "dome"] = Field("round", description="square or round with a flat bottom, or a dome")
    x: Span | None = metres(None, "rectangle that they fill; default from side to side")
    y: Span | None = metres(None, "rectangle that they fill; default from side to side (2D)")

    def part(self, extent: Extent) -> Shape:
        x = self.x or (0.0, extent.lengths[0])
        y = self.y or ((0.0, extent.lengths[1]) if len(extent.lengths) == 2 else (-inf, inf))
        cells = {"x": (x[1] - x[0]) / self.columns, "y": (y[1] - y[0]) / self.rows}
        for axis, cell in cells.items():
            if self.size > cell * (1.0 + SLACK):
                many = f"{self.columns if axis == 'x' else self.rows} along {axis}"
                raise InputError(
                    f"film: dimples of size {1e3 * self.size:g} mm in cells of {1e3 * cell:g} mm ({many}) would overlap; "
                    f"at most {1e3 * cell:g} mm is allowed"
                )
        return DimpleArray(self.form, self.depth, self.size, self.columns, self.rows, x, y)


class JournalPart(Part):
    """The gap of a journal in its bush, unwrapped over the length L: c (1 + eccentricity cos(2 pi (x - widest)/L))."""

    shape: Literal["journal"]
    c: Annotated[Finite, Field(gt=0)] = metres(..., "radial clearance")
    eccentricity: Annotated[Finite, Field(ge=0, lt=1)] = Field(..., description="relative eccentricity")
    widest: Finite = metres(0.0, "x of the widest gap")

    def part(self, extent: Extent) -> Shape:
        L = extent.lengths[0]
        if extent.journal is None:
            return Journal(self.c, self.eccentricity, L, self.widest)
        x, y = extent.journal  # the film is thinnest there
        return Journal(self.c, hypot(x, y), L, (0.5 + atan2(y, x) / (2.0 * pi)) * L)

    @property
    def changes(self) -> bool:
        return True


class HerringbonePart(Part):
    """Herringbone grooves right round, or along, that pump towards the middle of the width."""

    shape: Literal["herringbone"]
    depth: Annotated[Finite, Field(gt=0)] = metres(..., "depth of the grooves")
    count: Annotated[int, Field(strict=True, ge=1, le=10_000)] = Field(..., description="grooves along the length")
    angle_deg: Annotated[Finite, Field(gt=-90, lt=90)] = Field(
        30.0, description="against the direction of motion, degrees; negative: they pump outwards"
    )
    ratio: Annotated[Finite, Field(gt=0, lt=1)] = Field(0.5, description="width of a groove over groove and land")
    land: Annotated[Finite, Field(ge=0, lt=1)] = Field(0.0, description="share of the width in the middle without grooves")

    def check(self) -> None:
        super().check()
        if not self.angle_deg:
            raise ValueError("angle_deg = 0: grooves along the motion never meet; an angle above or below 0 is needed")

    def part(self, extent: Extent) -> Shape:
        return Herringbone(self.depth, self.count, radians(self.angle_deg), self.ratio, self.land, extent.both)


class Roughness(Part):
    """A random surface, the same one for a seed on every grid."""

    shape: Literal["roughness"]
    sigma: Annotated[Finite, Field(ge=0)] = metres(..., "standard deviation of the surface")
    seed: Annotated[int, Field(strict=True, ge=0)] = Field(1, description="another seed, another surface")
    cells: Annotated[int, Field(strict=True, ge=1, le=4000)] = Field(40, description="meshes of the surface along a side")

    def part(self, extent: Extent) -> Shape:
        return RandomSurface(self.sigma, self.seed, self.cells, extent.both)


class FormulaPart(Part):
    """A formula in x and y (metres), with [motion] in t (s) too: numbers, + - * / ^, functions, `a if x < 1 else b`."""

    shape: Literal["formula"]
    h: str = Field(..., description="the formula, as text")
    unit: Unit = Field("m", description="unit of its values")

    def check(self) -> None:
        super().check()
        Formula(self.h, ("x", "y", "t"))

    def part(self, extent: Extent) -> Shape:
        return Scaled(Formula(self.h, ("x", "y", "t")), UNITS[self.unit], extent.t)

    @property
    def changes(self) -> bool:
        return self.moves or "t" in Formula(self.h, ("x", "y", "t")).depends


class ProfilePart(Part):
    """A measured profile from a file."""

    shape: Literal["profile"]
    file: str = Field(
        ..., description=".csv with rows x, h or x, y, h; .npy or .tif with h from side to side; .x3p, .sur and others"
    )
    unit: Unit = Field("um", description="the file's unit of h (.csv, .npy, .tif)")
    unit_x: Unit = Field("mm", description="the file's unit of x and y (.csv)")
    interpolation: Literal["linear", "cubic", "nearest"] = Field("linear", description="between its points")
    uneven: bool = Field(False, description="the x of a .csv are meant to lie at uneven distances")

    def part(self, extent: Extent) -> Shape:
        units = UNITS[self.unit], UNITS[self.unit_x]
        return read_profile(extent.folder / self.file, extent.lengths, self.interpolation, *units, self.uneven)


if TYPE_CHECKING:
    FilmPart = Part
else:  # whatever the registry has, lines from outside among them
    FilmPart = Annotated[reduce(or_, (entry.load() for entry in SHAPES.values())), Field(discriminator="shape")]
