"""What a run to an accuracy knows before it solves: what its estimates hang on, and the grids it may take."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from math import inf, prod

from ...problems.film.model import Model
from ...problems.film.rims import depth_of
from ...problems.grid import OPEN, meshes_of
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Solvable
from ..ask import Ask
from ..warm import seeks
from .estimate import INTEGRALS, Traits, given_film, is_known
from .rungs import finer, first_rung, first_shape, round_ring

FEW_KNOWN = 128  # points of the first grid of a line whose number is known: no coarser grid is cheaper
FEW_PAIRS = 200  # of a film whose load is estimated from each two grids: these are solved by elimination
FEW_SLANTED = 1000  # of one with edges across the lines: coarser grids have strips of a cell or two
SHARE = 0.2  # of the scene's points that the first grid of a march has at least: its steps, in proportion, see what moves it


@dataclass(frozen=True)
class Course:
    """The grids of a run, by their rungs.

    Attributes
    ----------
    film : what its estimates hang on. first : shape of rung 0. meshes : its meshes a side. unit : of which the meshes along x
        are a multiple. begin : the rung to begin with. ring : whether a pair of sides is periodic. seeking : whether a place, a
        value or an attitude is sought.
    """

    film: Traits
    first: tuple[int, ...]
    meshes: Sequence[float]
    unit: int
    begin: int
    ring: bool
    seeking: bool

    @property
    def plane(self) -> bool:
        """Whether the grids have two sides."""
        return len(self.first) == 2

    def shape(self, rung: int) -> tuple[int, ...]:
        """The grid of a rung."""
        return finer(self.first, self.meshes, rung, self.unit)


def course_of(scene: Solvable, ask: Ask) -> Course:
    """The course of a run to `ask.accuracy` of `ask.quantity`. The same on every rank."""
    finest, model = ask.finest, film_of(scene)
    fewest = model.fewest_meshes() if model is not None else ()
    few = _few(scene, traits := _traits(scene, ask, model))
    first = first_shape(scene.shape, fewest, finest, few)
    if traits.pairs and first != first_shape(scene.shape, (), finest, few):
        traits = replace(traits, pairs=False)  # its cells are as wide as what they show
    first, unit = round_ring(scene, first, finest)
    sides = model.sides if isinstance(model, Model) else ()
    ends = [tuple(side.kind for side in sides[2 * k : 2 * k + 2]) or OPEN for k in range(len(first))]
    meshes = [meshes_of(n, pair) for n, pair in zip(first, ends, strict=True)]
    course = Course(traits, first, meshes, unit, 0, any("periodic" in pair for pair in ends), seeks(scene, ask))
    return replace(course, begin=_begin(course, ask, fewest))


def _traits(scene: Solvable, ask: Ask, model: Model | None) -> Traits:
    line, in_time = is_known(scene), motion_of(scene)
    first_order = model is not None and (model.scheme == "upwind" or model.mean_cubes)
    order = 1.0 if first_order or (in_time is not None and in_time.scheme == "euler") else 2.0
    rims, corners = (model.cut, model.cornered) if model is not None else (False, False)
    slanted = rims and any(map(depth_of, model.gap.rims))  # type: ignore[union-attr]
    # Of the load in the plane each two grids give an estimate; two that agree on where slanted edges lie say nothing of others.
    plane = len(scene.shape) == 2 and order > 1.0 and given_film(scene) is not None and not slanted
    return Traits(line, plane and ask.quantity in (None, *INTEGRALS), rims, corners, slanted, order)


def _few(scene: Solvable, traits: Traits) -> int | None:
    """Points of the first grid; None: the usual number."""
    if traits.line or traits.pairs:
        return FEW_KNOWN if traits.line else FEW_PAIRS
    if motion_of(scene) is not None:
        return int(SHARE * prod(scene.shape))
    return FEW_SLANTED if traits.slanted else None


def _begin(course: Course, ask: Ask, fewest: Sequence[int]) -> int:
    """The rung to begin with: the first one with two points a rank across the strips, and higher where coarse grids are no
    cheaper than those that tell more."""
    assert ask.accuracy is not None
    ranks, most, first = ask.mpi.size, ask.finest or (inf,) * len(course.first), course.first
    rung = next(k for k in count() if ranks == 1 or course.shape(k)[-1] >= 2 * ranks)
    if course.film.line and first[0] < FEW_KNOWN and course.shape(rung + 1)[0] <= most[0]:
        rung += 1
    narrow = any(n + 1 < 2 * least for n, least in zip(first, fewest, strict=False))
    later = first_rung(ask.accuracy, narrow) if course.film.pairs else 0
    room = all(n <= end for n, end in zip(course.shape(rung + later + 2), most, strict=True))
    return rung + later if room else rung
