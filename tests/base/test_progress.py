"""How far a long run has come: what loops tell, the line that is shown on a terminal and nowhere else."""

import io
import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ENVIRONMENT

from lcp_lube import load_scene, solve
from lcp_lube.base.progress import ORDER, Line, decades, duration, of_ladder
from lcp_lube.drivers.ask import Ask
from lcp_lube.output.console import coloured
from lcp_lube.studies.compare import compare
from lcp_lube.studies.optimise import optimise, parse_range


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_nothing_is_shown_at_once_and_nothing_off_a_terminal() -> None:
    now = [0.0]
    screen, file = Terminal(), io.StringIO()
    lines = [Line(stream, clock=lambda: now[0]) for stream in (screen, file)]
    for seconds in (0.5, 1.9, 4.0):
        now[0] = seconds
        for line in lines:
            line("grids", "grid 10", 0.25)
            if seconds < 2:
                assert screen.getvalue() == ""
    assert file.getvalue() == "" and "grid 10; about 12 s left" in screen.getvalue()
    lines[0].end()
    assert screen.getvalue().endswith("\r\x1b[K")


def test_the_outermost_loop_knows_the_time_left() -> None:
    line = Line(Terminal(), clock=lambda: 10.0)
    line("accuracy", "load to 1e-02", 0.5)
    line("grids", "grid 20", 0.9)
    assert line.text(20.0) == "lcp-lube: load to 1e-02, grid 20; about 10 s left"
    line("accuracy", "load to 5e-03", 0.8)  # its grid has ended
    assert line.text(20.0) == "lcp-lube: load to 5e-03; about 2 s left"


def test_words_and_parts() -> None:
    assert [duration(s) for s in (0.1, 40, 600, 7200)] == ["1 s", "40 s", "10 min", "2 h"]
    assert decades(1.0, 1e-4, 1e-8) == pytest.approx(0.5) and decades(1.0, 0.0, 1e-8) == 0.0
    assert decades(1.0, 1e-12, 1e-8) == 1.0 and decades(float("nan"), 1.0, 1e-8) == 0.0
    assert of_ladder([1.0, 4.0], 1e-2, 1e-3, 4.0) == pytest.approx(5.0 / (5.0 + 16.0 + 64.0))
    assert of_ladder([1.0], 1e-4, 1e-3, 4.0) == 1.0 and 0 < of_ladder([1.0], float("inf"), 1e-3, 4.0) < 0.1


@pytest.mark.parametrize(
    "scene, how, loop",
    [
        ("problem1", {"accuracy": 1e-4}, "accuracy"),
        ("problem4", {"n": 30, "method": "fas"}, "grids"),
        ("squeeze", {"n": 15, "steps": 6}, "time"),
    ],
)
def test_loops_tell(scene: str, how: dict[str, object], loop: str) -> None:
    told: list[tuple[str, str, float]] = []
    with solve(scene, **how, progress=lambda *what: told.append(what)) as solution:
        assert solution.converged
    assert {name for name, _, _ in told} <= set(ORDER) and all(0.0 <= part <= 1.0 for _, _, part in told)
    parts = [part for name, _, part in told if name == loop]
    assert parts and (loop == "grids" or parts[-1] == pytest.approx(1.0))
    if loop == "time":
        assert parts == sorted(parts) and len(parts) >= 6


def test_a_loop_over_items_tells_those_that_are_worked_on() -> None:
    """What was kept takes no time, and is not counted; the time left is that since the loop began, not since the start."""
    now = [0.0]
    screen = Terminal()
    line = Line(screen, clock=lambda: now[0])
    told: list[str] = []
    now[0] = 100.0
    with line:
        for _ in line.over("abcde", lambda item: f"{item}, row", lambda item: item in "bc"):
            now[0] += 3.0
            told.append(line.text(now[0]))
    assert told[0] == "lcp-lube: a, row 1 of 3" and told[1] == told[0] and told[2] == told[0]  # b and c were kept
    assert told[3] == "lcp-lube: d, row 2 of 3; about 24 s left"
    assert screen.getvalue().endswith("\r\x1b[K")


@pytest.mark.parametrize(
    "words, told",
    [
        (["table", "3", "--quick", "--results", "here"], b"row 2 of"),
        (["verify"], b" 2 of "),
        (["coefficients", "two_groove_journal", "--speeds", "1000:9000:60"], b"speed 9 of 60"),
    ],
)
def test_long_commands_tell_on_a_terminal(words: list[str], told: bytes, tmp_path: Path) -> None:
    """With the time that is left, and the words on stdout begin on a line of their own."""
    patience = "import sys; from lcp_lube.base import progress; progress.PATIENCE = progress.PAUSE = 0.0; "
    command = [sys.executable, "-c", f"{patience}from lcp_lube.__main__ import main; sys.exit(main())", *words]
    ours, theirs = pty.openpty()
    job = subprocess.Popen(command, cwd=tmp_path, env=ENVIRONMENT, stdout=theirs, stderr=theirs)
    os.close(theirs)
    shown = b""
    try:
        while told not in shown or b" left" not in shown:
            shown += os.read(ours, 4096)  # at the job's end: an error
    finally:
        job.kill()
        job.wait()
        os.close(ours)
    screen = shown.replace(b"\r\x1b[K", b"\n")
    assert all(line.startswith(b"lcp-lube: ") for line in screen.splitlines() if b" left" in line)


def test_a_comparison_tells_which_run_it_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, str, float]] = []
    monkeypatch.setattr(Line, "__call__", lambda self, *what: told.append(what))
    compare(load_scene("problem1", n=50), ["din", "active-set"])
    assert [what for what in told if what[0] == "sweep"] == [
        ("sweep", "din, run 1 of 2", 0.0),
        ("sweep", "active-set, run 2 of 2", 0.5),
    ]


def test_a_design_tells_where_it_is() -> None:
    told: list[tuple[str, str, float]] = []
    scene = load_scene("pocketed_pad", n=40)
    ranges = [parse_range(scene, "film.pocket.depth=5e-6:2e-5")]
    found = optimise(scene, "load", -1.0, ranges, ask=Ask(progress=lambda *what: told.append(what)), most=3)
    designs = [words for name, words, _ in told if name == "sweep"]
    assert len(designs) == found.designs > 1
    assert designs[0] == "design 1" and designs[1].startswith(f"design 2, load {found.start.results['load']:.4g}, ")
    assert designs[1].endswith(" left if it takes all 3 steps")


def test_colours_on_a_terminal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "scene\nconverged: 3 iterations"
    assert coloured(text, "converged", True) == text  # pytest's stdout is none
    monkeypatch.setattr(sys, "stdout", Terminal())
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert coloured(text, "converged", True) == text  # a rank's, whose stdout mpiexec made a terminal
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert coloured(text, "converged", True) == "scene\n\x1b[32mconverged\x1b[0m: 3 iterations"
    assert "\x1b[1;31mstalled" in coloured("scene\nstalled: 3", "stalled", False)
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured(text, "converged", True) == text


def test_output_of_a_pipe_has_no_trace_of_it(tmp_path: Path) -> None:
    """On a terminal stderr may have a line that is cleared; the summary is on stdout all the same."""
    command = [sys.executable, "-m", "lcp_lube", "solve", "problem1", "--n", "30"]
    ours, theirs = pty.openpty()
    done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=theirs, check=False)
    os.close(theirs)
    os.close(ours)
    assert done.returncode == 0 and b"\x1b" not in done.stdout and b"converged" in done.stdout


def test_compilation_is_told_on_a_terminal_once(tmp_path: Path) -> None:
    """With an empty cache, and not again from a full one."""
    pytest.importorskip("numba")
    program = (
        "from lcp_lube.base.compiled import compiled; from kernels import one, two; compiled(one)(1.0); compiled(two)(1.0)"
    )
    (tmp_path / "kernels.py").write_text("def one(x):\n    return x + 1.0\n\n\ndef two(x):\n    return x + 2.0\n")
    for times in (1, 0):
        ours, theirs = pty.openpty()
        environment = {**ENVIRONMENT, "PYTHONPATH": f"{ENVIRONMENT.get('PYTHONPATH', '')}{os.pathsep}{tmp_path}"}
        done = subprocess.run([sys.executable, "-c", program], cwd=Path(__file__).parents[2], env=environment, stderr=theirs)
        os.write(theirs, b"end")
        shown = os.read(ours, 4096)
        os.close(theirs)
        os.close(ours)
        assert done.returncode == 0 and shown.count(b"loops are compiled") == times, shown
