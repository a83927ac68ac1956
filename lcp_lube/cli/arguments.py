"""The command line's grammar. Own options begin with two dashes; every single-dash option is PETSc's. No PETSc here."""

import argparse
import re
from pathlib import Path
from typing import NoReturn

from .. import __version__
from ..errors import InputError, nearest
from ..registry import STABILITY
from . import design_arguments
from .common_arguments import json_option, number, results_option, scene_options, solver_options, whole
from .examples import EXAMPLES


class Parser(argparse.ArgumentParser):
    """argparse, but an error is an InputError: one line, with the nearest legal name."""

    def error(self, message: str) -> NoReturn:
        unknown = re.match(r"unrecognized arguments: (--\S+)", message)
        if unknown:
            message = f"{unknown[1]}: no such option{nearest(unknown[1].partition('=')[0], self.option_names())}"
        wrong = re.match(r"argument (\S+): invalid choice: '(.*?)' \(choose from (.*)\)", message)
        if wrong:
            legal = [name.strip("' ") for name in wrong[3].split(",")]
            message = f"{wrong[1]} {wrong[2]}: allowed are {', '.join(legal)}{nearest(wrong[2], legal)}"
        raise InputError(message)

    def option_names(self) -> list[str]:
        """Of this parser and of its commands: the error of an unknown option is raised at the top."""
        own = [option for action in self._actions for option in action.option_strings]
        below = [parser for action in self._actions if isinstance(action.choices, dict) for parser in action.choices.values()]
        return [*own, *(name for parser in below for name in parser.option_names())]


def parse(own: list[str]) -> argparse.Namespace:
    """The command and its options; `words`: what they were read from."""
    return parser_of_all().parse_args(own, argparse.Namespace(words=own))


def parser_of_all() -> Parser:
    """The grammar of every command."""
    parser = Parser(
        prog="lcp-lube",
        description="Cavitation in lubricated bearings as a complementarity problem, solved with PETSc.",
        epilog="Every single-dash option goes to PETSc (-ksp_type gmres -pc_type ilu -log_view); put them after SCENE. "
        "-help lists them.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"lcp-lube {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)

    def command(name: str, text: str) -> argparse.ArgumentParser:
        example = f"example: {EXAMPLES[name]}" if name in EXAMPLES else None
        return commands.add_parser(name, help=text, description=text, epilog=example, allow_abbrev=False)

    solve = command("solve", "solve a scene")
    solver_options(solve)
    solve.add_argument(
        "--no-memory-check", action="store_true", help="begin even if the estimate says that memory is too short"
    )
    solve.add_argument(
        "--reduction",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="solve no more than symmetry leaves (--explain says what); default yes",
    )
    solve.add_argument(
        "--certify", action="store_true", help="prove how far the answer is from the exact discrete solution at most (films)"
    )
    solve.add_argument(
        "--accuracy",
        type=number,
        metavar="TOL",
        help="finer and finer grids until the load's estimated relative error is below TOL; --n, --nx, --ny: no finer ones",
    )
    solve.add_argument("--quantity", metavar="NAME", help="what --accuracy is about: load (default), p_max, friction, ...")
    solve.add_argument("--output", action="append", default=[], metavar="FILE", help=".npz, .nc, .vts or .pvd (ParaView), .h5")
    solve.add_argument("--boundary", action="store_true", help="--output writes the points of the sides as well")
    solve.add_argument("--plot", metavar="FILE.png", help="picture of p, r and h; of a film that moves: of the march, or .gif")
    solve.add_argument("--plot-model", metavar="FILE.png", help="picture of the effects that were kept and left out")
    solve.add_argument("--history", metavar="FILE.csv", help="a row for each time step, as they come (films that move)")
    solve.add_argument(
        "--times", metavar="T,T,...", help="times (s), or their number, of the frames of --plot FILE.gif and --output FILE.pvd"
    )
    json_option(solve)
    solve.add_argument("--explain", action="store_true", help="say on stderr what was chosen, and why")
    solve.add_argument("--monitor", action="store_true", help="a line an iteration on stderr")

    solve.add_argument("--ranks", type=whole, metavar="N", help="as an MPI job of N processes on this machine's cores")
    solve.add_argument("--checkpoint", metavar="FILE", help="save the iterate here, in one piece, so that --resume can go on")
    solve.add_argument("--every", type=whole, metavar="N", help="a checkpoint after every N steps, default 1")
    solve.add_argument("--resume", metavar="FILE", help="go on from a checkpoint of this scene, on any number of ranks")

    compare = command("compare", "several methods and recipes on one scene, in one table")
    scene_options(compare)
    compare.add_argument("--methods", default="din", metavar="A,B,...", help="default din")
    compare.add_argument("--recipes", default="", metavar="A,B,...", help="default: the default recipe")
    compare.add_argument("--json", action="store_true", help="a JSON list of the runs")

    sweep = command("sweep", "a scene at many values of its keys: one csv row a point, warm starts")
    solver_options(sweep)
    sweep.add_argument(
        "--vary",
        action="append",
        required=True,
        metavar="KEY=FROM:TO:N",
        help="N values from FROM to TO, both among them (FROM:TO:N:log: at equal ratios), or a list A,B,C; several --vary: all "
        "combinations, the last varying fastest",
    )
    sweep.add_argument(
        "--output", type=Path, metavar="FILE.csv", help="filled row by row; points that stand there are not solved again"
    )
    text = "start from the answer of the point before, along the last --vary; default yes"
    sweep.add_argument("--warm", action=argparse.BooleanOptionalAction, default=True, help=text)
    text = "processes side by side, each with lines of points along the last --vary (--no-warm: points); default: where it pays"
    sweep.add_argument("--jobs", type=whole, metavar="N", help=text)
    sweep.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)  # one of these processes

    table = command("table", "reproduce a published table beside the printed one")
    table.add_argument("number", type=int, metavar="K")
    table.add_argument("--paper", default="mezzadri", choices=["mezzadri", "bergamaschi"])
    table.add_argument("--quick", action="store_true", help="leave the long rows out")
    table.add_argument("--fitted", action="store_true", help="settings fitted to the paper's counts in place of printed ones")
    table.add_argument("--stored", action="store_true", help="run nothing: print the rows of --results with their age")
    results_option(table)

    chart = command("chart", "long experiments: the runs in a csv, the pictures drawn from it")
    charts = chart.add_subparsers(dest="chart", required=True, metavar="precision|stability|scaling|rungs", parser_class=Parser)
    text = "errors of load, largest pressure and rupture, and what they cost, for every method, system and recipe"
    precision = charts.add_parser("precision", help=text, description=text, allow_abbrev=False)
    precision.add_argument("scenes", nargs="*", metavar="SCENE", help="films; default: seven of them, see studies/precision.py")
    text = "where methods fail: " + "; ".join(f"{name}, {entry.line}" for name, entry in STABILITY.items())
    stability = charts.add_parser("stability", help=text, description=text, allow_abbrev=False)
    stability.add_argument("maps", nargs="*", metavar="MAP", help=f"any of {', '.join(STABILITY)}; default all")
    text = "a whole solve's cost by grid and by ranks: run it under mpiexec -n 1, 2, 4, ... in turn"
    scaling = charts.add_parser("scaling", help=text, description=text, allow_abbrev=False)
    text = "effects one by one: what each buys in accuracy, and costs, on five scenes"
    rungs = charts.add_parser("rungs", help=text, description=text, allow_abbrev=False)
    for parser_of_chart in (precision, stability, scaling, rungs):
        parser_of_chart.add_argument("--quick", action="store_true", help="a small chart in seconds, with a csv of its own")
        results_option(parser_of_chart)

    verify = command("verify", "known answers: ours, reference, error, observed order, verdict")
    verify.add_argument("--quick", action="store_true", help="one case in a moment")
    json_option(verify)

    coefficients = command("coefficients", "stiffness and damping of a journal's film, or of a pad's along its normal")
    solver_options(coefficients)
    coefficients.add_argument(
        "--frequency", default="0", metavar="F,F,...", help="of the motion, rad/s; default 0, the limit of slow motion"
    )
    coefficients.add_argument(
        "--speeds", metavar="FROM:TO:N", help="a csv row for each speed (rpm), in the columns and axes of rotor programs"
    )
    coefficients.add_argument("--output", type=Path, metavar="FILE.csv", help="of --speeds; default standard output")
    coefficients.add_argument("--tilt", action="store_true", help="with the slopes of a journal's axis: 4 x 4, with moments")
    coefficients.add_argument("--plot", metavar="FILE.png", help="of --speeds: K and C against S and the speed")
    json_option(coefficients)

    design_arguments.add(command)

    explore = command("explore", "a local page with the scene's numbers as sliders; pressure, film and numbers follow")
    solver_options(explore)
    text = "relative error at which refining ends; default 1e-3"
    explore.add_argument("--accuracy", type=number, default=1e-3, metavar="TOL", help=text)
    explore.add_argument("--port", type=whole, default=0, metavar="N", help="of 127.0.0.1; default: any free one")
    text = "open the page in a browser; default yes"
    explore.add_argument("--browser", action=argparse.BooleanOptionalAction, default=True, help=text)

    doctor = command("doctor", "what is installed, what is missing, and a short self-check on one and two ranks")
    json_option(doctor)

    new = command("new", "a commented scene file to edit, which solves to the same numbers as the scene that it is made from")
    new.add_argument("file", type=Path, metavar="FILE.toml")
    new.add_argument("--from", dest="source", required=True, metavar="SCENE", help="a .toml file or a built-in name")

    command("list", "scenes, methods, systems and recipes, each with a line")
    return parser
