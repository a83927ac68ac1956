"""The grammar of `sensitivity` and `optimise`."""

import argparse
from collections.abc import Callable
from pathlib import Path

from .common_arguments import json_option, solver_options, whole


def add(command: Callable[[str, str], argparse.ArgumentParser]) -> None:
    """Add both commands; command : makes one's parser."""
    sensitivity = command("sensitivity", "what matters: derivatives of a number by every number of the scene, ranked")
    solver_options(sensitivity)
    sensitivity.add_argument("--quantity", default="load", metavar="Q,Q,...", help="default load; vectors by part, force_x")
    sensitivity.add_argument("--by", metavar="KEY,KEY,...", help="numbers of the scene; default all of them")
    sensitivity.add_argument(
        "--tolerance",
        action="append",
        default=[],
        metavar="KEY=U",
        help="standard deviation of a number, 1um or 5%% of its value, h for the film's level: error bars; adds to [tolerance]",
    )
    text = "confirm the error bars by so many solves with normally distributed numbers"
    sensitivity.add_argument("--monte-carlo", type=whole, metavar="N", help=text)
    sensitivity.add_argument("--seed", type=whole, default=1, help="of these numbers, default 1")
    sensitivity.add_argument("--plot", metavar="FILE.png", help="bars, and the film's own derivative at every point")
    text = "where the grid's error of the first quantity comes from, cell by cell: one more solve, at half the spacing"
    sensitivity.add_argument("--errors", metavar="FILE.png", help=text)
    sensitivity.add_argument("--output", metavar="FILE", help="fields with d(Q)/dh per area: .npz, .vts (ParaView) or .h5")
    json_option(sensitivity)

    optimise = command("optimise", "the numbers of a scene, within bounds, that make one of its results largest or smallest")
    solver_options(optimise)
    optimise.add_argument("--maximise", metavar="Q", help="a number of the results: load, ...")
    optimise.add_argument("--minimise", metavar="Q", help="or this: friction, friction_coefficient, ...")
    text = "a number of the scene and its range, dimples.depth=0um:10um; several --vary"
    optimise.add_argument("--vary", action="append", default=[], metavar="KEY=FROM:TO", help=text)
    text = "a limit that the design keeps, 'friction<=1'; several --subject"
    optimise.add_argument("--subject", action="append", default=[], metavar="Q<=BOUND", help=text)
    optimise.add_argument("--steps", type=whole, default=100, metavar="N", help="of the optimiser at most, default 100")
    optimise.add_argument("--output", type=Path, metavar="FILE.toml", help="the best design as a scene")
    text = "every design is a row of it, and those that are there are not solved again; default FILE.csv beside --output"
    optimise.add_argument("--history", type=Path, metavar="FILE.csv", help=text)
    json_option(optimise)
