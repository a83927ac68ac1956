"""Options that several commands have, and how their values are read."""

import argparse
from pathlib import Path

from ..base.quantity import in_si
from ..errors import InputError


def number(text: str) -> float:
    """A number, 1e-4, .75 or 1%; its unit would have nothing to be checked against."""
    try:
        value = in_si(text, "")
        return float(text) if value is None else value  # nan and inf are for others to refuse
    except InputError as error:
        raise argparse.ArgumentTypeError(f"{text}: {error}") from None
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid float value: {text!r}") from None


def whole(text: str) -> int:
    """A whole number, 200 or 1e3."""
    try:
        return int(text)
    except ValueError:
        pass
    try:
        value = in_si(text, "")
    except InputError:
        value = None
    if value is None or not value.is_integer():
        raise argparse.ArgumentTypeError(f"invalid int value: {text!r}")
    return int(value)


def results_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("lcp_lube_results"),
        metavar="DIR",
        help="where the runs are kept: those that are there are not made again; default lcp_lube_results",
    )


def scene_options(parser: argparse.ArgumentParser) -> None:
    """What all commands with a scene take."""
    parser.add_argument("scene", metavar="SCENE", help="a .toml file or a built-in name, see 'lcp-lube list'")
    parser.add_argument("--n", type=whole, help="interior points (a side, in 2D)")
    parser.add_argument("--nx", type=whole)
    parser.add_argument("--ny", type=whole)
    parser.add_argument("--film", help="sinusoid or parabola (published problems)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a scene's value (SI), film.pocket.depth=1e-6 in a table, or METHOD.OPTION for a method's, din.gamma=0.4",
    )
    parser.add_argument("--system", default="auto", help="which matrix the inner solver sees; default auto")
    parser.add_argument(
        "--nested",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="start from the answers on coarser grids; default: where it pays",
    )
    parser.add_argument(
        "--model",
        default="auto",
        metavar="auto|full|least|NAMES",
        help="effects (see 'lcp-lube list') to solve for of those that the scene names: auto (default) leaves out what changes "
        "the quantity asked by less than a tenth of the tolerance",
    )
    parser.add_argument(
        "--no-rescue", action="store_true", help="if the method fails, say so; by default another takes over, and is named"
    )
    parser.add_argument("--eps1", type=number, help="stop when ||F|| <= eps1, default 1e-8 (fas: 1e-11, interior: 8e-8)")
    parser.add_argument("--eps2", type=number, help="and ||alpha d|| <= eps2, default 1e-8 (fas and box scenes: no such test)")
    parser.add_argument("--max-it", type=whole, default=500, help="at most so many outer iterations, default 500")
    parser.add_argument("--p0", help="start of p in the scene's p_unit (MPa in the published problems), 1; or 1bar")
    parser.add_argument("--r0", type=number, help="start of r, 0.1")
    parser.add_argument("--mu", help="perturbation: mu1, mu2 (default) or adaptive")
    parser.add_argument("--conditions", help="step-length conditions, any of the letters FRCB; default FCB")


def solver_options(parser: argparse.ArgumentParser) -> None:
    """And those that solve it by one method."""
    scene_options(parser)
    parser.add_argument("--method", default="auto", help="see 'lcp-lube list'; default auto")
    parser.add_argument("--recipe", help="inner solver: options/NAME.opts; explicit PETSc options win over it")


def json_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
