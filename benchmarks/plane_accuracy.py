"""Accuracy in the plane: what a grid of so many points gives on films with edges, by scheme face (docs/accuracy.md).

python benchmarks/plane_accuracy.py              # the pads of 5 x 5 dimples: square, round, domes
python benchmarks/plane_accuracy.py --offsets 40 # a pocket at random places: errors of the numbers, order, worst place
python benchmarks/plane_accuracy.py --cycles     # multigrid on uneven lines and on even ones
"""

import argparse
from dataclasses import replace

import numpy as np

from lcp_lube import load_scene, solve
from lcp_lube.drivers.ask import Ask
from lcp_lube.drivers.compose import solve as compose
from lcp_lube.drivers.grooves import PadFilm
from lcp_lube.problems.grid import EVEN

SIZES = (40, 79, 80, 95, 131, 159, 160, 191, 320, 639)
# N above the cavitation pressure; of round edges towards which 1279, 1919, 2559 and 3199 points a side go
FORCES = {"square": 6.1981, "round": 7.0775, "dome": 7.2370}
NUMBERS = ("pressure_integral", "friction", "p_max", "cavitated_area")
GRIDS = (20, 40, 80, 160)
FINE = 640


def pads(sizes: tuple[int, ...]) -> None:
    """Errors of the force of the pads of dimples, in %."""
    print("points a side " + "".join(f"{n:>8}" for n in sizes))
    for form, force in FORCES.items():
        errors = []
        for n in sizes:
            solution = solve(load_scene("dimpled_pad", {"nx": n, "ny": n, "film.dimples.form": form}))
            errors.append(100.0 * (solution.numbers["pressure_integral"] / force - 1.0) if solution.converged else np.nan)
            solution.destroy()
        print(f"{form:>13} " + "".join(f"{error:8.3f}" for error in errors), flush=True)


def pocket(n: int, t: float, u: float) -> list[float]:
    """The numbers of a wedge with a pocket, moved by t and u mm."""
    film = [
        {"shape": "linear", "h_start_um": 2.4, "h_end_um": 2.0},
        {"shape": "pocket", "depth_um": 2.5, "x_mm": [2.0 + t, 5.0 + t], "y_mm": [2.5 + u, 6.5 + u]},
    ]
    data = {"family": "bearing", "dimension": 2, "L_mm": 10, "width_mm": 10, "U": 1.0, "n": n, "film": film}
    solution = solve(load_scene({**data, "fluid": {"mu": 0.02, "p_supply": 1e5}}))
    found = [float(solution.numbers[name]) for name in NUMBERS]
    solution.destroy()
    return found


def offsets(count: int) -> None:
    """Over random places of the pocket: median errors in %, worst over median, order by a fit of the medians."""
    places = np.random.default_rng(1).random((count, 2))
    found = np.array([[pocket(n, *place) for n in (*GRIDS, FINE)] for place in places])
    errors = 100.0 * np.abs(found[:, :-1] / found[:, -1:] - 1.0)
    print(f"{'':>18}" + "".join(f"{f'{n} a side':>20}" for n in GRIDS) + "   order")
    for k, name in enumerate(NUMBERS):
        median, worst = np.median(errors[..., k], axis=0), errors[..., k].max(axis=0)
        order = -np.polyfit(np.log(GRIDS), np.log(median), 1)[0]
        row = "".join(f"{m:12.4f} x {w / m:4.1f} " for m, w in zip(median, worst, strict=True))
        print(f"{name:>18}{row} {order:6.2f}", flush=True)


def cycles(sizes: tuple[int, ...]) -> None:
    """Multigrid's cycles and mean factor on lines on the edges, and on even ones of the same numbers of points."""
    print(f"{'points':>8}{'lines':>9}{'cycles':>8}{'factor':>8}")
    for n in sizes:
        scene = load_scene("dimpled_pad", {"nx": n, "ny": n})
        model = scene.model
        for name, places in (("edges", model.lines((n, n))), ("even", EVEN)):
            film = PadFilm(scene, replace(model, places=places), (n, n), 0)
            solution = compose(film, Ask(method="fas"))
            details = solution.settings["details"]
            print(f"{n:>8}{name:>9}{details['cycles']:>8}{details['convergence_factor'] or np.nan:8.3f}", flush=True)
            solution.destroy()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--offsets", type=int, metavar="N", help="so many random places of a pocket")
    parser.add_argument("--cycles", action="store_true", help="multigrid on uneven and even lines")
    parser.add_argument("--most", type=int, default=320, help="largest number of points a side (default 320)")
    args = parser.parse_args()
    sizes = tuple(n for n in SIZES if n <= args.most)
    if args.offsets:
        offsets(args.offsets)
    elif args.cycles:
        cycles(tuple(n for n in sizes if n >= 79))
    else:
        pads(sizes)


if __name__ == "__main__":
    main()
