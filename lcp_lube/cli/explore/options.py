"""The command's own options."""

import argparse
from collections.abc import Callable


def explore_options(parser: argparse.ArgumentParser, number: Callable[[str], float], whole: Callable[[str], int]) -> None:
    """Add them; `number` and `whole` read a value."""
    parser.add_argument("--method", default="auto", help="see 'lcp-lube list'; default auto")
    parser.add_argument("--recipe", help="inner solver: options/NAME.opts; explicit PETSc options win over it")
    parser.add_argument(
        "--accuracy", type=number, default=1e-3, metavar="TOL", help="relative error at which refining ends; default 1e-3"
    )
    parser.add_argument("--port", type=whole, default=0, metavar="N", help="of 127.0.0.1; default: any free one")
    parser.add_argument(
        "--browser", action=argparse.BooleanOptionalAction, default=True, help="open the page in a browser; default yes"
    )
