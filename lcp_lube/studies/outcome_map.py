"""A map of outcomes over a pair of parameters: its runs, from the csv or made now, its sentence and its picture.

Each map is a file of its own with an `OutcomeMap`; `registry.STABILITY` has a line for it.
"""

import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..base.progress import Line
from ..base.resumable import ResumableCsv, Row
from ..errors import InputError
from ..output.console import say
from ..problems.solution import Step
from ..registry import METHODS
from ..scenes.scene import Scene, load_scene
from ..solvers.newton import Stopping
from .drawing import save
from .experiment import FELL_BACK, open_store, run
from .log import write_log
from .map_picture import FAILURES, KRYLOV_MOST, Axis, Panels, converged, groups, picture
from .reference import WRONG, Reference, References

COLUMNS = ("distance", "reference", "system", "cpu_s", "command")


@dataclass(frozen=True)
class Case:
    """One run: its key columns, the scene with its changes (`late`: those that take long to find), `api.solve`'s choices."""

    key: dict[str, Any]
    scene: str
    changes: dict[str, Any] = field(default_factory=dict)
    choices: dict[str, Any] = field(default_factory=dict)
    late: Callable[[], dict[str, Any]] = dict

    def load(self) -> Scene:
        return load_scene(self.scene, {**self.changes, **self.late()})

    def command(self) -> str:
        """The line that makes this run again."""
        choices, stopping = self.choices, self.choices.get("stopping")
        words: list[Any] = ["lcp-lube", "solve", self.scene]
        words += [
            w for k, v in {**self.changes, **self.late()}.items() for w in (("--n", v) if k == "n" else ("--set", f"{k}={v}"))
        ]
        method = choices.get("method", "auto")
        for flag, name in (("--method", "method"), ("--system", "system"), ("--recipe", "recipe")):
            if choices.get(name):
                words += [flag, choices[name]]
        for name, value in choices.get("options", {}).items():
            known = name in ("p0", "r0", "mu", "conditions")
            words += [f"--{name}", value] if known else ["--set", f"{method}.{name}={value}"]
        if "nested" in choices:
            words.append("--nested" if choices["nested"] else "--no-nested")
        if isinstance(stopping, Stopping):
            words += ["--eps1", f"{stopping.eps1:g}", "--eps2", f"{stopping.eps2:g}"]
        return shlex.join(map(str, words))


@dataclass(frozen=True)
class OutcomeMap:
    """What tells one map from another. Its files are stability_{stem}.csv and .png (stability_{stem}_quick...).

    panels, x, y : which key columns make panels, and which the cells within them; rows that share a cell are counted together.
    reference : what runs are judged by; default the discrete solution.
    more : further columns of a run, from the record of its steps; columns : their names.
    right : whether a run is as it must be.
    """

    stem: str
    cases: Callable[[bool], Iterable[Case]]
    panels: Panels
    x: Axis
    y: Axis
    sentence: Callable[[Sequence[Row]], str]
    reference: Callable[[Scene], Reference] | None = None
    more: Callable[[Case, Sequence[Step]], dict[str, Any]] | None = None
    columns: tuple[str, ...] = ()
    right: Callable[[Row], bool] = converged

    def chart(self, quick: bool, results: Path) -> int:
        """Make the runs that are not in the csv yet, then draw; a run that fails is a cell of the map. Collective."""
        stem = f"stability_{self.stem}" + "_quick" * quick
        cases = list(self.cases(quick))
        key = (*cases[0].key, "ranks")
        store = open_store(results / f"{stem}.csv", key, (*COLUMNS, *self.columns))
        find = self.reference or References().of
        ranks = {"ranks": store.comm.size}
        with Line() as line:
            runs = line.over(cases, lambda _: f"{self.stem}, run", lambda case: store.find(**case.key, **ranks) is not None)
            rows = [row for case in runs if (row := self.row(store, case, find)) is not None]
        sentence = f"Numbers: steps. {self.sentence(rows)} {judged(rows)}"
        say(sentence)
        failed = [row for row in rows if row.get("method") == "auto" and not self.right(row)]
        for row in failed:
            say(f"auto failed: {row['command']}: {row['message']}")
        path = results / f"{stem}.png"
        save(lambda: picture(rows, self.panels, self.x, self.y, sentence, self.right), path, store.comm)
        if not quick:
            lines = ["", "What `auto` fails at:", "", *(f"- `{row['command']}`" for row in failed)] if failed else []
            write_log(results, f"stability: {self.stem}", rows, "\n".join([sentence, *lines]), [path])
        say(f"{path}: {len(rows)} runs, {store.said}")
        return 0

    def row(self, store: ResumableCsv, case: Case, reference: Callable[[Scene], Reference]) -> Row | None:
        """The row of one run, from the csv or made now; None if it was refused. Collective."""
        key = {**case.key, "ranks": store.comm.size}
        if (row := store.find(**key)) is not None:
            return row
        scene, steps = case.load(), list[Step]()
        try:
            values = run(scene, KRYLOV_MOST, reference(scene), steps, **case.choices)
        except InputError as error:
            say(f"{case.command()}: left out: {error}")
            return None
        more = self.more(case, steps) if self.more else {}
        return store.add({**values, **more, **key, "command": case.command()})


def methods() -> list[str]:
    """'auto', and every method of the registry for films."""
    return ["auto", *(name for name, entry in METHODS.items() if "lubrication" in entry.kinds)]


def tally(rows: Sequence[Row], axes: Sequence[Axis], right: Callable[[Row], bool] = converged) -> str:
    """How many of some runs are right, how the others end, and over which values of the axes these lie."""
    failed = [row for row in rows if not right(row)]
    most = max((int(row["iterations"]) for row in rows if right(row)), default=0)
    if not failed:
        return f"all {len(rows)}, in {most} steps at most"
    ends = Counter(row["outcome"] for row in failed)
    ways = ", ".join(f"{count} {FAILURES.get(outcome, [outcome])[-1]}" for outcome, count in ends.most_common())
    where = "; ".join(text for axis in axes if (text := extent(failed, rows, axis)))
    return f"{len(rows) - len(failed)} of {len(rows)} (fail: {ways}{': ' * bool(where)}{where})"


def extent(failed: Sequence[Row], rows: Sequence[Row], axis: Axis) -> str:
    """From where to where on an axis some runs lie; empty if that is all of it."""
    every, some = (sorted({float(row[axis.column]) for row in some}) for some in (rows, failed))
    if some[0] == every[0] and some[-1] == every[-1]:
        return ""
    if some[0] == some[-1]:
        return f"{axis.name} {some[0]:g}"
    if some[-1] == every[-1]:
        return f"{axis.name} from {some[0]:g}"
    return f"{axis.name} to {some[-1]:g}" if some[0] == every[0] else f"{axis.name} {some[0]:g} to {some[-1]:g}"


def tallies(rows: Sequence[Row], by: Sequence[str], axes: Sequence[Axis], right: Callable[[Row], bool] = converged) -> str:
    """`tally` of each group of runs, as one sentence; groups with the same tally are listed together."""
    said: dict[str, list[str]] = {}
    for names, mine in groups(rows, by).items():
        said.setdefault(tally(mine, axes, right), []).append(" ".join(names))
    return "Right answers: " + "; ".join(f"{', '.join(names)}: {text}" for text, names in said.items()) + "."


def judged(rows: Sequence[Row]) -> str:
    """What the reference says of the certificate: how far certified answers were from it, and how many runs had none."""
    known = [row for row in rows if row["distance"]]
    good = [float(row["distance"]) for row in known if row["outcome"] in ("converged", FELL_BACK)]
    caught = [row for row in known if row["outcome"] == "wrong_solution"]
    by_distance = [row for row in caught if "from the reference" in row["message"]]
    text = f"Certified answers are within {max(good):.0e} of the reference" if good else ""
    if caught:
        alarms = sum(float(row["distance"]) <= WRONG for row in caught)
        wrong = len(caught) - alarms
        text += f"; of {wrong} wrong ones the certificate saw {wrong - len(by_distance)}" * bool(wrong)
        text += f"; it refused {alarms} that are as near as {WRONG:g}" * bool(alarms)
    without = len(rows) - len(known)
    return f"{text}{f'; {without} runs had no reference' * bool(without)}." if text else ""
