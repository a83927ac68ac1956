"""The look at a scene's effects that `decision` takes: to first order on a film's answer, or by solving without each."""

from dataclasses import replace
from math import exp, isfinite, log1p, prod
from typing import Any

import numpy as np

from ...errors import InputError
from ...problems.solution import Solution
from ...registry import RUNGS, SMALL
from ...scenes.effects.named import named, without
from ...scenes.moving import motion_of
from ..accuracy.accuracy import DEFAULT_QUANTITY, WHOLE, find_value
from ..ask import Ask, Start
from ..compose import Inner
from .coupling import NESTED_ABOVE, nests
from .decision import total_work
from .first_order import FirstOrder

TOLERANCE = 0.01  # of the quantity, unless an accuracy is asked for
PART = 0.1  # of the tolerance: what changes the quantity by less is left out, so that ten such effects stay within it
WIDEST = 10.0  # change of log(e/(1 - e)) that is foretold
INFINITE = 1e30  # where the place of the walls is found, every effect acts on all others
ACTING, DOUBT = 0.2, 0.5  # of the product of two effects' sizes: what one may change by acting on the other; of the rigid film
FIRST, SHARE_FIRST = 600, 0.05  # points of the film that is looked at, at least, and in parts of the fine grid
SHARE = 0.10  # of the fine solve's work that coarse ones may take, by points: films differ in number, 0.15 is promised
SHARE_TIME = 0.13  # the same of a march in time, by its steps
LEAST = {1: 15, 2: 6}  # points a side of a coarse grid, at least
FREE = {"barus"}  # a change of the unknown: it costs nothing, and is always kept
COARSE_EPS1 = 1e-7  # far below a coarse grid's own error, so that differences of two such films tell the effect alone
PLACE = 1e-2  # by which the load of a film that is looked at may be off
FEWEST = 5  # steps of a march that is looked at, at least


def coarse_shape(shape: tuple[int, ...], solves: int) -> tuple[int, ...] | None:
    """The grid for the decision: so many solves on it cost `SHARE` of one on `shape`; None where it would be too small."""
    coarse = _coarser(shape, SHARE / solves)
    return coarse if min(coarse) >= LEAST[len(shape)] and coarse[0] >= 2 * LEAST[2] else None


def _coarser(shape: tuple[int, ...], part: float) -> tuple[int, ...]:
    """A grid with this part of the points."""
    coarse = tuple(max(1, int(part ** (1.0 / len(shape)) * n)) for n in shape)
    if len(shape) == 2 and coarse[1] < LEAST[2] <= shape[1]:  # few lines: keep them, take the points along
        coarse = (max(1, int(part * prod(shape) / LEAST[2])), LEAST[2])
    return coarse


def looked(names: list[str]) -> list[str]:
    """The effects that may be left out."""
    return [name for name in names if name not in FREE]


def few_steps(motion: Any, solves: int) -> int:
    """The steps of a march that is looked at, up to the same end: so many marches cost `SHARE_TIME` of the whole one's."""
    return FEWEST if motion.step is None else int(SHARE_TIME * motion.t_end / motion.step / solves)


class Look:
    """What is known of a scene's effects so far. Collective, as its methods.

    Attributes
    ----------
    kept : effects to solve for. effects : what each changes, dQ/Q. doubtful : left out, to be looked at again on the answer.
    record : how that was found. work : of the decision, unknowns times films. solution : the answer, where it is known already.
    ask : that of the solve which follows.
    """

    def __init__(self, scene: Any, names: list[str], ask: Ask, inner: Inner):
        self.scene, self.names, self.ask, self.inner = scene, names, ask, inner
        self.kept, self.effects, self.sizes = list(names), dict[str, float](), dict[str, float]()
        self.record: dict[str, Any] = {}
        self.doubtful: list[str] = []
        self.work, self.limit = 0.0, PART * (ask.accuracy or TOLERANCE)
        self.solution: Solution | None = None
        self.first: Solution | None = None
        self.found: Any = None

    @property
    def _free(self) -> list[str]:
        return [name for name in self.names if name in FREE]

    @property
    def reduced(self) -> Any:
        """The scene with the effects that are kept."""
        gone = [name for name in self.names if name not in self.kept]
        return without(self.scene, gone) if gone else self.scene

    def decide(self) -> None:
        """By first order; where there are no derivatives, by solving without each."""
        if set(self.names) <= FREE:
            self.record = {"reason": "alone it costs nothing"}
            return
        motion = motion_of(self.scene)
        if motion is not None:
            if few_steps(motion, len(looked(self.names)) + 2) < FEWEST:
                self.record = {"reason": "the march has so few steps that all are solved for"}
            else:
                self.kept, self.effects, self.record, self.work = _by_solving(self.scene, self.names, self.ask, self.inner)
            return
        if coarse_shape(self.scene.shape, len(self.names) + 1) is None:
            self.record = {"reason": "the grid is so small that all are solved for"}
            return
        shape = first_shape(self.scene.shape, getattr(self.scene, "balance", None) is not None)
        filed = self.ask.checkpoint is not None or self.ask.resume is not None
        own = shape == self.scene.shape and self.ask.accuracy is None and not filed
        try:
            rigid = without(self.scene.with_shape(shape), [name for name in self.names if name not in FREE])
            table = getattr(rigid, "balance", None)
            if table is not None:  # the place need not be exact: what is kept moves it
                rigid = rigid.model_copy(update={"balance": table.model_copy(update={"tol": max(table.tol, PLACE)})})
            first = self.inner(rigid, self.ask if own and table is None else quick(self.ask, shape))
        except InputError:
            self.record = {"reason": f"no film without effects on {shape} points"}
            return
        self.first = first
        if not first.converged:
            self.record = {"reason": f"no answer without effects: {first.message}"}
            return
        try:
            balance = first.settings.get("balance")
            quantity = self.ask.quantity or (balance["vary"] if balance else DEFAULT_QUANTITY[0])  # that every film has
            film = FirstOrder(self.scene, first, self._free, quantity)
        except InputError:
            self.kept, self.effects, self.record, self.work = _by_solving(self.scene, self.names, self.ask, self.inner)
            return
        changes = {name: film.change(name) for name in self.names}
        self.found = film.found
        self.effects = {name: change for name, (change, _) in changes.items() if change is not None}
        self.sizes = {name: size for name, (_, size) in changes.items()}
        small = [name for name in self.names if self._small(film, name)]
        self.kept = [name for name in self.names if name in FREE or name not in small]
        acting = DOUBT if not film.found.found else INFINITE
        self.doubtful = [name for name in self.names if name not in self.kept and not self._sure(name, acting)]
        self.work = first.problem.unknowns + (0 if own else total_work(first))
        self.record = {"quantity": quantity, "tolerance": self.ask.accuracy or TOLERANCE, "grid": list(shape)}
        if own and table is None and self.kept == self._free:
            self.solution, self.first = first, None
        elif (own or (table is not None and self.ask.accuracy is None and not filed)) and self.ask.start is None:
            first.problem.moving.cells = made = film.made(self.kept)  # type: ignore[attr-defined]
            itself = None if film.found.found else made  # else the loop's first film is at another place
            self.ask = replace(self.ask, start=Start(first.problem, first.fields, self._foretold(first.settings), itself))
        film.destroy()

    def _foretold(self, settings: Any) -> Any:
        """Settings of the film without effects, with the value that a balance is expected to find with those kept."""
        balance = settings.get("balance")
        if not balance or balance["vary"] != self.record["quantity"]:
            return settings
        value = balance["value"]
        grows = sum(log1p(self.effects.get(name, 0.0)) for name in self.kept if name not in FREE)
        if balance["vary"].rpartition(".")[2] == "eccentricity":
            value = 1.0 / (1.0 + (1.0 / value - 1.0) * exp(-min(max(grows / (1.0 - value), -WIDEST), WIDEST)))
        else:
            value *= exp(grows)
        return {**settings, "balance": {**balance, "value": value, "foretold": True}}

    def _small(self, film: FirstOrder, name: str) -> bool:
        """Whether an effect by itself does not count: to second order, where its square could."""
        first, size = self.effects.get(name, 1.0), self.sizes[name]
        if abs(first) + DOUBT * size * size < self.limit:
            return True
        if abs(first) >= self.limit or name in FREE:
            return False
        self.effects[name] = second = film.second(name)
        return abs(second) + abs(second - first) * size < self.limit

    def _sure(self, name: str, acting: float) -> bool:
        """Whether an effect could not count by acting on those that are kept."""
        others = sum(self.sizes[other] for other in self.kept)
        return abs(self.effects[name]) + (acting * self.sizes[name] * others if others else 0.0) < self.limit

    def again(self, solution: Solution) -> bool:
        """Look at the answer; whether more effects are kept now."""
        try:
            film = FirstOrder(self.scene, solution, self.kept, self.record["quantity"], self.found)
        except InputError:
            return False
        more = []
        for name in self.doubtful:
            change, self.sizes[name] = film.change(name)
            self.effects[name] = self.effects[name] if change is None else change
            if change is None or not self._small(film, name) or not self._sure(name, ACTING):
                more.append(name)
        film.destroy()
        self.work += solution.problem.unknowns
        self.kept = [name for name in self.names if name in self.kept or name in more]
        self.doubtful = [name for name in self.doubtful if name not in more]
        return bool(more)

    def taken_up(self, kept: list[str]) -> None:
        """A run goes on that may have found at its first answer that more effects count."""
        self.kept = [name for name in self.names if name in {*self.kept, *kept}]
        self.doubtful = [name for name in self.doubtful if name not in kept]

    def destroy(self) -> None:
        if self.first is not None:
            self.first.destroy()


def quick(ask: Ask, shape: tuple[int, ...]) -> Ask:
    """For a film that is looked at on so many points, and thrown away."""
    none = dict.fromkeys(("accuracy", "quantity", "finest", "start", "monitor", "checkpoint", "resume", "watch", "progress"))
    halved = ask.reduction and prod(shape) > WHOLE[False]
    return replace(ask, **none, times=(), certify=False, reduction=halved, stopping={"eps1": COARSE_EPS1})  # type: ignore[arg-type]


def first_shape(shape: tuple[int, ...], sought: bool = False) -> tuple[int, ...]:
    """The grid on which the film without effects is looked at; sought : by several films, as for its place."""
    points = prod(shape)
    own = points <= NESTED_ABOVE or not (sought or nests(shape))
    return shape if own else _coarser(shape, min(max(FIRST, SHARE_FIRST * points), SMALL) / points)


def _by_solving(
    scene: Any, names: list[str], ask: Ask, inner: Inner
) -> tuple[list[str], dict[str, float], dict[str, Any], float]:
    """Effects to keep, what each changes on a coarse grid, how that was found, and the work. Collective."""
    tol = ask.accuracy or TOLERANCE
    motion = motion_of(scene)
    shape = coarse_shape(scene.shape, len(names) + 1) if motion is None else first_shape(scene.shape, True)
    assert shape is not None  # for the type checker: `decide` has looked
    if "area" in (ask.quantity or "") and PART * tol * prod(shape) < 1.0:  # it goes in parts of a cell
        return names, {}, {"reason": f"on the coarse grid {shape} {ask.quantity} does not tell so small a change"}, 0.0
    coarse, in_time = scene.with_shape(shape), ""
    if motion is not None:
        steps = few_steps(motion, len(looked(names)) + 2)
        in_time = f" in {steps} steps"
        coarse = coarse.model_copy(update={"motion": motion.model_copy(update={"steps": steps, "dt": None, "tol": None})})
    try:
        full = inner(coarse, quick(ask, shape))
    except InputError:
        return names, {}, {"reason": f"no film on the coarse grid {shape}{in_time}"}, 0.0
    work, effects = total_work(full), {}
    try:
        if not full.converged:
            return names, {}, {"reason": f"no answer on the coarse grid {shape}{in_time}: {full.message}"}, 0.0
        value, quantity = _quantity(full, ask.quantity, scene)

        def effect(gone: list[str]) -> float | None:
            """What these change together, dQ/Q."""
            nonlocal work
            bare = without(coarse, gone)
            if not named(bare):  # a line's numbers are exact without effects, and the others have the grid's error
                bare = bare.model_copy(update={"viscosity": RUNGS["viscosity"].load()(factor="1")})
            try:
                other = inner(bare, replace(quick(ask, shape), start=full))
            except InputError:
                return None
            work += total_work(other)
            reference = _quantity(other, quantity, scene)[0] if other.converged else None
            history = other.history
            other.destroy()
            if reference is None or value is None:
                return None
            if full.history and quantity in history[0]:
                return _over_time(full.history, history, quantity)
            return value / reference - 1.0 if reference and isfinite(value / reference) else None

        effects = {
            name: found for name in (names if motion is None else looked(names)) if (found := effect([name])) is not None
        }
        kept = [name for name in names if not abs(effects.get(name, 1.0)) < PART * tol]
        gone = sorted((name for name in names if name not in kept), key=lambda name: abs(effects[name]))
        together = effect(gone) if len(gone) > 1 else 0.0
        while len(gone) > 1 and (together is None or not abs(together) < len(gone) * PART * tol):
            kept.append(gone.pop())
            together = effect(gone) if len(gone) > 1 else 0.0
    finally:
        full.destroy()
    work *= 1.0 if motion is None or motion.step is None else steps * motion.step / motion.t_end
    return kept, effects, {"quantity": quantity, "tolerance": tol, "grid": list(shape)}, work


def _over_time(rows: list[dict[str, Any]], others: list[dict[str, Any]], quantity: str) -> float | None:
    """The largest difference of two marches' quantity, with its sign, in parts of the largest value of the second."""
    (t, values), (times, known) = ([np.array([row[name] for row in one]) for name in ("t", quantity)] for one in (rows, others))
    off, size = values - np.interp(t, times, known), np.max(np.abs(known))
    return float(off[np.argmax(np.abs(off))] / size) if size > 0.0 and np.all(np.isfinite(off)) else None


def _quantity(solution: Solution, quantity: str | None, scene: Any) -> tuple[float | None, str]:
    """The quantity asked for, as `accuracy` has it, and its name; None where this model has no such number."""
    found = solution.problem.quantities(solution.fields)
    balance = solution.settings.get("balance")
    if balance:
        found = {balance["vary"]: balance["value"], **found}
    motion = motion_of(scene)
    usual = ("min_h",) if motion is not None and motion.free else DEFAULT_QUANTITY  # a free journal's load is given
    name = quantity or (balance["vary"] if balance else next((one for one in usual if one in found), ""))
    if quantity is not None and name not in found:
        return None, name
    return find_value(found, name, scene), name
