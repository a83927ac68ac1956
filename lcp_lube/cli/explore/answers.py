"""What the page asks: the scene with some values changed, solved on a coarse grid first and on finer ones when asked again."""

import base64
import json
import tempfile
from dataclasses import asdict, replace
from math import isfinite, prod
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ... import api
from ...drivers.ask import Ask
from ...errors import InputError
from ...output.files import gather, taken, thinning
from ...output.results import as_dict, finite
from ...problems.solution import Outcome, Solution
from ...registry import scene_names
from ...scenes.scene import Scene, load_scene, parse_changes, scene_line
from ...scenes.written import toml_of
from .controls import controls

COARSE = {1: 400, 2: 3000}  # points of the first grid at most
FOLLOWS = 0.12  # seconds that it may take: half of the delay that one notices, the rest is the browser's
PATIENCE = 2.0  # seconds that a finer grid may take
SHOWN = {1: 1200, 2: 160}  # points a side that are sent
TOO_FAR = 30  # levels that anyone could ask for


class Answers:
    """One scene, any number of pages: nothing is kept of a page, which says with every request what it has changed.

    base : the scene before any change.
    """

    def __init__(self, base: Scene, ask: Ask, accuracy: float):
        self.base, self.ask, self.accuracy = base, ask, accuracy
        self._points = COARSE[len(base.shape)]

    def reply(self, what: str, request: dict[str, Any]) -> tuple[bytes, str]:
        """The answer's bytes and their kind."""
        changes, level = self._read(request)
        if what in ("scene", "solve"):
            answer = self.scene() if what == "scene" else self.solve(changes, level)
            return json.dumps(finite(answer)).encode(), "application/json"
        if what == "toml":
            return toml_of(load_scene(self.base, changes)).encode(), "application/toml"  # type: ignore[arg-type]
        if what == "picture":
            return self.picture(changes, level), "image/png"
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

    def solve(self, changes: dict[str, Any], level: int) -> dict[str, Any]:
        """Numbers, fields and reasons on one of the grids."""
        begin = perf_counter()
        solution, shape = self._solution(changes, level)
        with solution:
            seconds = perf_counter() - begin
            if level == 0:
                self._adapt(seconds, shape)
            record = as_dict(solution)
            estimate = record.get("accuracy_estimate")
            finer = 4.0 if len(shape) == 2 else 2.0
            reached = estimate is not None and estimate <= self.accuracy
            return finite(
                {
                    "seconds": seconds,
                    "level": level,
                    "grid": " x ".join(map(str, solution.problem.grid.shape)),
                    "solved": solution.outcome in (Outcome.CONVERGED, Outcome.ACCURACY),
                    "outcome": solution.outcome.sentence,
                    "message": solution.message,
                    "reached": reached,
                    "last": reached or (level > 0 and finer * seconds > PATIENCE) or finer * seconds > 2 * PATIENCE,
                    "estimate": estimate,
                    "quantity": record.get("accuracy_quantity"),
                    "why": [line for line in solution.settings["why"] if line],
                    "warnings": record["warnings"],
                    "numbers": _numbers(solution),
                    **_fields(solution),
                }
            )

    def picture(self, changes: dict[str, Any], level: int) -> bytes:
        """The picture of --plot."""
        solution, _ = self._solution(changes, level)
        with solution, tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.png"
            solution.plot(path)
            return path.read_bytes()

    def _solution(self, changes: dict[str, Any], level: int) -> tuple[Solution, tuple[int, ...]]:
        scene = load_scene(self.base, changes)  # type: ignore[arg-type]
        shape = scene.shape
        while prod(shape) > self._points and min(shape) > 8:
            shape = tuple((n - 1) // 2 for n in shape)
        shape = tuple((n + 1) * 2**level - 1 for n in shape)
        return api.solve(scene, replace(self.ask, accuracy=self.accuracy, finest=shape)), shape

    def _adapt(self, seconds: float, shape: tuple[int, ...]) -> None:
        """Fewer points on the first grid where the machine cannot keep up with the sliders, more again where it can."""
        if seconds > FOLLOWS:
            self._points = max(min(self._points, prod(shape)) // 2, 50)
        elif seconds < FOLLOWS / 6:
            self._points = min(2 * self._points, COARSE[len(shape)])


def _numbers(solution: Solution) -> list[dict[str, Any]]:
    """Every number of the answer with its unit; a table's entries by themselves, a vector's parts as a list."""
    found = []
    for name, value in solution.numbers.items():
        parts = {f"{name} {part}": inner for part, inner in value.items()} if isinstance(value, dict) else {name: value}
        unit = solution.units.get(name, "")
        for label, inner in parts.items():
            number = isinstance(inner, int | float) and not isinstance(inner, bool) and isfinite(inner)
            vector = isinstance(inner, list | tuple) and 0 < len(inner) <= 4 and all(isinstance(x, int | float) for x in inner)
            if number or vector:
                found.append({"name": label, "value": inner, "unit": unit})
    return found


def _fields(solution: Solution) -> dict[str, Any]:
    """Coordinates, and fields as 32-bit numbers in base64; a fine grid thinned."""
    grid = solution.problem.grid
    stride = thinning(grid, SHOWN)
    lines = {name: line[taken(line.size, step)] for name, line, step in zip("xy", grid.lines, stride, strict=False)}
    fields = {
        name: {"unit": unit, "values": _packed(gather(grid, values, stride))}
        for name, (values, unit) in solution.problem.physical(solution.fields).items()
    }
    return {
        "axes": {name: {"unit": solution.units["x"], "values": line.tolist()} for name, line in lines.items()},
        "fields": fields,
    }


def _packed(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()
