"""What the precision chart says in words: which run is cheapest for an accuracy, and what fails, from the rows alone."""

import re
from collections import Counter
from collections.abc import Sequence

from ..base.resumable import Row
from ..output.table import table
from .map_picture import groups

LEVELS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
PEER = "peer"  # what stands in the column `system` for other codes
ASKED = (1e-2, 1e-4)  # what the pictures answer: a per cent, a hundredth of it


def seconds(row: Row) -> float:
    """What a run costs: seconds by the clock, or of the processor where that is less, because other jobs slowed the clock."""
    return min(float(row["wall_s"]), float(row["cpu_s"]))


def timed(rows: Sequence[Row]) -> list[Row]:
    """The rows whose seconds may be compared: for each scene those of the machine with the most rows, except those made
    while it was busy.

    Where most were made while it was busy, none is left out.
    """
    return [row for mine in by_scene(rows).values() for row in _quiet(mine)]


def _quiet(rows: Sequence[Row]) -> list[Row]:
    machine = _machine(rows)
    cores = int(found[1]) if (found := re.search(r"(\d+) cores", machine)) else 1
    here = [row for row in rows if (row.get("machine") or "") == machine]
    quiet = [row for row in here if float(row.get("load_average") or 0.0) <= cores]
    return quiet if 2 * len(quiet) > len(here) else here


def _machine(rows: Sequence[Row]) -> str:
    return Counter(row.get("machine") or "" for row in rows).most_common(1)[0][0]


def untimed(rows: Sequence[Row]) -> str:
    """How many rows count for outcomes and iterations alone; with several machines, which scenes' seconds are from which."""
    count = len(rows) - len(timed(rows))
    text = f" Seconds are not compared of {count} runs of another or a busy machine." if count else ""
    machines: dict[str, list[str]] = {}
    for scene, mine in by_scene(rows).items():
        machines.setdefault(_machine(mine), []).append(scene)
    if len(machines) > 1:
        most = max(machines, key=lambda name: len(machines[name]))
        others = "; ".join(f"{', '.join(scenes)} on {name}" for name, scenes in machines.items() if name != most)
        text += f" Machine: {most}; {others}."
    return text


def error(row: Row, quantity: str) -> float | None:
    """The error to draw; None for a run that failed.

    The larger one of the whole error and of its parts, that of the grid and that of the iteration: where they happen to cancel
    a run is not accurate.
    """
    values = [float(row[name]) for part in ("error", "grid", "iteration") if row.get(name := f"{quantity}_{part}")]
    return max(values) if row["outcome"] == "converged" and values else None


def loose(row: Row, quantity: str) -> bool:
    """Whether the iteration's part of the error is the larger one."""
    return float(row.get(f"{quantity}_iteration") or 0.0) > float(row.get(f"{quantity}_grid") or 0.0)


def published(row: Row) -> bool:
    """Whether a run is the paper's DIN: on the 2n system, from its own start."""
    return (row["method"], row["system"], row["nested"]) == ("din", "full", "False")


def front(rows: Sequence[Row], quantity: str) -> list[Row]:
    """The Pareto front, from fast to accurate: no other run beats one in seconds and, by one part in ten, in error."""
    best: list[Row] = []
    least = float("inf")
    for row in sorted(rows, key=seconds):
        here = error(row, quantity)
        if here is not None and here < 0.9 * least:
            best.append(row)
            least = here
    return best


def fastest(rows: Sequence[Row], level: float, quantity: str = "load") -> Row | None:
    """The fastest run with an error of at most `level`, of those whose reference is known as accurately."""
    sure = [row for row in rows if float(row.get(f"{quantity}_unsure") or 0.0) <= level]
    good = [row for row in sure if (here := error(row, quantity)) is not None and here <= level]
    return min(good, key=seconds, default=None)


def by_scene(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return {scene: mine for (scene,), mine in groups(rows, ("scene",)).items()}


def cheapest(rows: Sequence[Row]) -> list[str]:
    """Lines of a table: for each scene and method the seconds of its fastest run within each of LEVELS, and which one it is."""
    lines = []
    for scene, mine in by_scene(timed(rows)).items():
        head = f"{scene}: seconds of the fastest run whose load is within"
        cells = [[head, *map(percent, LEVELS)]]
        for method in dict.fromkeys(row["method"] for row in mine):
            theirs = [row for row in mine if row["method"] == method]
            runs = [fastest(theirs, level) for level in LEVELS]
            none = "not run" if finest(theirs) < finest(mine) else "-"
            cells.append([f"  {method}", *(f"{seconds(run):.2g}" if run else none for run in runs)])
        lines += table(cells, align="<", least=[0, *[8] * len(LEVELS)])
        for level in LEVELS:
            run = fastest(mine, level)
            if run:
                lines.append(f"  fastest within {percent(level)}: {describe(run)}")
    return lines


def which(rows: Sequence[Row]) -> list[str]:
    """Which method when, as a table in Markdown: the fastest run for each of ASKED, and how much longer others take."""
    lines = ["| scene | error of the load | fastest | s | paper's DIN | other codes |", "|---|---|---|---|---|---|"]
    for scene, mine in by_scene(timed(rows)).items():
        for level in ASKED:
            best = fastest(mine, level)
            if best is None:
                lines.append(f"| {scene} | {percent(level)} | no run is known to | | | |")
                continue
            rivals = []
            for theirs in (list(filter(published, mine)), [row for row in mine if row["system"] == PEER]):
                rival = fastest(theirs, level)
                label = f"{rival['method']}, " * (rival["system"] == PEER) if rival else ""
                rivals.append(
                    f"{label}{two_digits(seconds(rival) / seconds(best))} times" if rival else unreached(theirs, mine)
                )
            name = describe(best).rpartition(": ")[0]
            lines.append(f"| {scene} | {percent(level)} | {name} | {time(best)} | {' | '.join(rivals)} |")
    return lines


def finest(rows: Sequence[Row]) -> int:
    """Points of the largest grid that some runs were made on."""
    return max((int(row["points"]) for row in rows if row["points"]), default=0)


def unreached(theirs: Sequence[Row], everyone: Sequence[Row]) -> str:
    """Why no run of some reaches an accuracy: they were not run on grids as fine as others', or it is beyond them."""
    if not theirs:
        return "not run"
    if finest(theirs) < finest(everyone):
        largest = max((row["n"] for row in theirs if row["points"]), key=int)
        return f"not run above {largest} a side: minutes"
    return "does not get there"


def describe(row: Row) -> str:
    """A run in a few words."""
    nested = ", nested" * (row["nested"] == "True" and row["n"] != "auto")
    inner = f"{row['system']} system, {row['recipe']}, " if row["system"] not in ("auto", "peer") else ""
    return f"{row['method']}{nested}, {inner}eps {float(row['eps']):g}, n = {row['n']}: {time(row)}"


def two_digits(value: float) -> str:
    """110 rather than 1.1e+02."""
    return f"{float(f'{value:.2g}'):g}"


def time(row: Row) -> str:
    """Its seconds, as 2.1 ms or 1.3 s."""
    value = seconds(row)
    return f"{value:.2g} s" if value >= 1 else f"{1e3 * value:.2g} ms" if value < 0.1 else f"{1e3 * value:.0f} ms"


def percent(level: float) -> str:
    return f"{100 * level:g} %"


def failures(rows: Sequence[Row]) -> str:
    """How many runs failed, by method."""
    failed = Counter(row["method"] for row in rows if row["outcome"] != "converged")
    where = ", ".join(f"{method} {count}" for method, count in failed.most_common())
    return f"{failed.total()} of {len(rows)} runs failed{f' ({where})' * bool(failed)}."


def sentence(rows: Sequence[Row], quantity: str) -> str:
    """For each of ASKED which method is fastest on how many scenes, and how much longer the paper's DIN takes."""
    parts = []
    scenes = by_scene(timed(rows))
    for level in ASKED:
        bests = {scene: best for scene, mine in scenes.items() if (best := fastest(mine, level, quantity))}
        wins = Counter(row["method"] for row in bests.values())
        text = f"Within {percent(level)} fastest: " + ", ".join(f"{name} on {count}" for name, count in wins.most_common())
        din = {s: fastest([row for row in scenes[s] if published(row)], level, quantity) for s in bests}
        ratios = sorted(seconds(row) / seconds(bests[s]) for s, row in din.items() if row)
        if ratios:
            least, most = two_digits(ratios[0]), two_digits(ratios[-1])
            text += f"; the paper's DIN (2n system, no coarser grids) takes {least} to {most} times as long"
        lost = len(scenes) - len(bests)
        text += f"; on {lost} of {len(scenes)} scenes no run is known to" if lost else ""
        parts.append(f"{text}." if bests else f"Within {percent(level)}: no run.")
    return f"{' '.join(parts)} {failures(rows)}{untimed(rows)}"
