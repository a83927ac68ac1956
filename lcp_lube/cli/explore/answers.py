"""What the page asks: the scene with some values changed, solved on a coarse grid first and on finer ones when asked again.

The first answer is one solve on a coarse grid, where that takes long to a few digits, from the last one; of a film in time it
is what a tenth of a second has come to, and the whole march follows, shown on its way. Finer ones have an estimate of their
error.
"""

import base64
import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from math import isfinite, prod
from pathlib import Path
from time import perf_counter
from typing import Any

from ... import api
from ...drivers.ask import Ask
from ...errors import InputError
from ...output.files import gather, taken, thinning
from ...output.results import as_dict, finite
from ...problems.solution import Fields, Outcome, Problem, Solution
from ...registry import scene_names
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Scene, as_scene, parse_changes, scene_line
from ...scenes.written import toml_of
from .controls import controls

COARSE = {1: 400, 2: 3000}  # points of the first grid at most
FOLLOWS = 0.12  # seconds that it may take: half of the delay that one notices, the rest is the browser's
PATIENCE = 2.0  # seconds that a finer grid may take
QUICK = 3e-3  # where the first answer is slow: its eps1, and what may be left of a load: less than its grid's error
JSON = "application/json"
GRIDS = 7.0  # times a march that an estimate of its error takes: three grids
SHOWN = {1: 1200, 2: 160}  # points a side that are sent
TOO_FAR = 30  # levels that anyone could ask for


class Enough(Exception):
    """Of a march: there is something to show."""


def _no_news(*news: Any) -> None:
    """Nobody waits for it."""


class Answers:
    """One scene, any number of pages: nothing is kept of a page, which says with every request what it has changed.

    base : the scene before any change.
    """

    def __init__(self, base: Scene, ask: Ask, accuracy: float):
        self.base, self.ask, self.accuracy = base, ask, accuracy
        self._most = self._points = COARSE[len(base.shape)]
        self._slow = False  # whether first answers start from the last one, which is kept for that alone
        self._near: Solution | None = None
        self.moves = motion_of(base) is not None

    def reply(
        self,
        what: str,
        request: dict[str, Any],
        alive: Callable[..., None] = _no_news,
        show: Callable[[bytes], None] = _no_news,
    ) -> tuple[bytes, str]:
        """The answer's bytes and their kind.

        Parameters
        ----------
        alive : called often meanwhile; what it raises ends the solve.
        show : called with answers of a film in time before it has come to its end.
        """
        changes, level = self._read(request)
        if what == "scene":
            return _json(self.scene()), JSON
        if what == "solve":
            return _json(self.solve(changes, level, alive, lambda answer: show(_json(answer)))), JSON
        if what == "toml":
            return toml_of(as_scene(self.base, changes)).encode(), "application/toml"
        if what == "picture":
            return self.picture(changes, level, alive), "image/png"
        raise InputError(f"{what}: no such question")

    @staticmethod
    def _read(request: dict[str, Any]) -> tuple[dict[str, Any], int]:
        changes, level = request.get("changes", {}), request.get("level", 0)
        if not isinstance(changes, dict) or not all(isinstance(word, str) for pair in changes.items() for word in pair):
            raise InputError("changes: texts by key are needed")
        if type(level) is not int or not 0 <= level <= TOO_FAR:
            raise InputError(f"level: 0 to {TOO_FAR} is needed")
        return parse_changes(f"{key}={value}" for key, value in changes.items() if value.strip()), level

    def scene(self) -> dict[str, Any]:
        """The scene's name and its controls."""
        name = self.base.name
        line = scene_line(name) if name in scene_names() else " ".join((type(self.base).__doc__ or "").split())
        return {"name": name, "line": line, "accuracy": self.accuracy, "controls": [asdict(one) for one in controls(self.base)]}

    def solve(
        self,
        changes: dict[str, Any],
        level: int,
        alive: Callable[..., None] = _no_news,
        show: Callable[[dict[str, Any]], None] = _no_news,
    ) -> dict[str, Any]:
        """Numbers, fields and reasons on one of the grids; `alive` and `show` as `reply` has them."""
        scene, ask = self._asked(changes, level)
        ask = replace(ask, progress=alive)
        if self.moves and level < 2:
            return self._in_time(scene, ask, level, show)
        begin = perf_counter()
        solution = api.solve(scene, ask)
        seconds = perf_counter() - begin
        answer = self._answer(solution, level, seconds)
        if level == 0:
            self._adapt(seconds, scene.shape, solution)
        else:
            solution.destroy()
        return answer

    def _answer(self, solution: Solution, level: int, seconds: float) -> dict[str, Any]:
        """A solution as the page shows it."""
        record = as_dict(solution)
        estimate = record.get("accuracy_estimate")
        finer = 4.0 if solution.problem.grid.dim == 2 else 2.0
        reached = estimate is not None and estimate <= self.accuracy
        return {
            "seconds": seconds,
            "level": level,
            "solved": solution.outcome in (Outcome.CONVERGED, Outcome.ACCURACY),
            "outcome": solution.outcome.sentence,
            "message": solution.message,
            "reached": reached,
            "last": reached or (level > 0 and finer * seconds > PATIENCE) or level == TOO_FAR,
            "estimate": estimate,
            "quantity": record.get("accuracy_quantity"),
            "why": [line for line in solution.settings["why"] if line],
            "warnings": record["warnings"] if level else [],  # those of the first grid are not the scene's
            **_shown(solution.problem, solution.fields, solution.numbers, solution.units),
        }

    def _in_time(self, scene: Scene, ask: Ask, level: int, show: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
        """A film in time: the state reached in `FOLLOWS` seconds, or all of it, with answers on the way."""
        begin = shown = perf_counter()
        first: dict[str, Any] = {}
        motion = motion_of(scene)
        assert motion is not None
        end = motion.t_end

        def watch(moment: Any) -> None:
            nonlocal first, shown
            now = perf_counter()
            if now - shown < FOLLOWS or moment.t >= end:
                return
            shown = now
            problem, fields = moment.problem, moment.fields
            first = {
                "seconds": now - begin,
                "level": level,
                "solved": True,
                "reached": False,
                "last": False,
                "estimate": None,
                "time": [moment.t, end],
                "why": [f"in time: step {moment.count}"],
                "warnings": [],
                **_shown(problem, fields, problem.quantities(fields), problem.units),
            }
            if level == 0:
                raise Enough
            show(first)

        try:
            with api.solve(scene, replace(ask, watch=watch)) as solution:
                seconds = perf_counter() - begin
                answer = self._answer(solution, level, seconds)
                return answer | {"last": level > 0 and GRIDS * seconds > 2 * PATIENCE}
        except Enough:
            return first

    def picture(self, changes: dict[str, Any], level: int, alive: Callable[..., None] = _no_news) -> bytes:
        """The picture of --plot."""
        scene, ask = self._asked(changes, level)
        with api.solve(scene, replace(ask, progress=alive)) as solution, tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.png"
            solution.plot(path)
            return path.read_bytes()

    def _asked(self, changes: dict[str, Any], level: int) -> tuple[Scene, Ask]:
        """The scene on the grid of a level, or what is asked of a ladder that ends there."""
        scene = as_scene(self.base, changes)
        moves = self.moves
        shape, grooved = scene.shape, bool(getattr(film_of(scene), "grooves", ()))  # their edges are points
        while prod(shape) > (self._most if level else self._points) and min(shape) > 8:
            shape = (shape[0] // 2 if grooved else (shape[0] - 1) // 2, *((n - 1) // 2 for n in shape[1:]))
        if level > moves:
            shape = tuple((n + 1) * 2 ** (level - 1 - moves) - 1 for n in shape)
            return scene, replace(self.ask, accuracy=self.accuracy, finest=shape)
        if level or moves or not self._slow:
            return scene.with_shape(shape), self.ask
        if (balance := getattr(scene, "balance", None)) is not None and balance.tol < QUICK:
            scene = as_scene(scene, {"balance.tol": QUICK})
        stopping = self.ask.stopping or {"eps1": QUICK}
        # So few points are solved in less time than it takes to see that half of them would do.
        return scene.with_shape(shape), replace(self.ask, stopping=stopping, start=self._near, reduction=False)

    def _adapt(self, seconds: float, shape: tuple[int, ...], solution: Solution) -> None:
        """Fewer points on the first grid, and a start, where the machine cannot keep up with the sliders; more where it can."""
        self._slow = self._slow or seconds > FOLLOWS
        if seconds > FOLLOWS:
            self._points = max(min(self._points, prod(shape)) // 2, 50)
        elif seconds < FOLLOWS / 6:
            self._points = min(2 * self._points, self._most)
        self.forget()
        if self._slow and solution.converged:
            self._near = solution
        else:
            solution.destroy()

    def forget(self) -> None:
        """Nothing is near any more."""
        if self._near is not None:
            self._near.destroy()
        self._near = None


def _json(answer: dict[str, Any]) -> bytes:
    """In one line."""
    return json.dumps(finite(answer)).encode()


def _shown(problem: Problem, fields: Fields, found: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, Any]:
    """Grid, numbers and fields."""
    grid = " x ".join(map(str, problem.grid.shape))
    return {"grid": grid, "numbers": _numbers(found, units), **_fields(problem, fields)}


def _numbers(numbers: Mapping[str, Any], units: Mapping[str, str]) -> list[dict[str, Any]]:
    """Every number of the answer with its unit; a table's entries by themselves, a vector's parts as a list."""
    found = []
    for name, value in numbers.items():
        parts = {f"{name} {part}": inner for part, inner in value.items()} if isinstance(value, dict) else {name: value}
        for label, inner in parts.items():
            number = isinstance(inner, int | float) and not isinstance(inner, bool) and isfinite(inner)
            vector = isinstance(inner, list | tuple) and 0 < len(inner) <= 4 and all(isinstance(x, int | float) for x in inner)
            if number or vector:
                found.append({"name": label, "value": inner, "unit": units.get(name, "")})
    return found


def _fields(problem: Problem, fields: Fields) -> dict[str, Any]:
    """Coordinates, and fields as 32-bit numbers in base64; a fine grid thinned."""
    grid = problem.grid
    stride = thinning(grid, SHOWN)
    lines = {name: line[taken(line.size, step)] for name, line, step in zip("xy", grid.lines, stride, strict=False)}
    found = problem.physical(fields)
    packed = {name: gather(grid, array, stride).astype("<f4").tobytes() for name, (array, _) in found.items()}
    values = {name: {"unit": found[name][1], "values": base64.b64encode(packed[name]).decode()} for name in found}
    length = "m" if any(unit for _, unit in found.values()) else ""
    return {"axes": {name: {"unit": length, "values": line.tolist()} for name, line in lines.items()}, "fields": values}
