"""The grammar of `sensitivity` and `optimise`."""

import argparse
from collections.abc import Callable
from typing import Any


def add(
    command: Callable[[str, str], argparse.ArgumentParser],
    scene_options: Callable[[argparse.ArgumentParser], None],
    number: Callable[[str], float],
    whole: Callable[[str], int],
) -> None:
    """Add both commands.

    Parameters
    ----------
    command : makes a command's parser. scene_options : adds what all commands with a scene take. number, whole : read values.
    """
    sensitivity = command("sensitivity", "what matters: derivatives of a number by every number of the scene, ranked")
    _solver_options(sensitivity, scene_options)
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
    sensitivity.add_argument("--output", metavar="FILE", help="fields with d(Q)/dh per area: .npz, .vts (ParaView) or .h5")
    sensitivity.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")


def _solver_options(parser: argparse.ArgumentParser, scene_options: Callable[[Any], None]) -> None:
    scene_options(parser)
    parser.add_argument("--method", default="auto", help="see 'lcp-lube list'; default auto")
    parser.add_argument("--recipe", help="inner solver of the film: options/NAME.opts")
