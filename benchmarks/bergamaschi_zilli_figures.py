"""Figures 1 to 3 of Bergamaschi and Zilli: convergence of the interior method, film and pressure of the line contact.

python benchmarks/bergamaschi_zilli_figures.py [--results benchmarks/results]
"""

import argparse
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import petsc4py
from matplotlib.figure import Figure

petsc4py.init(sys.argv[:1])

from mpi4py import MPI  # noqa: E402

from lcp_lube.api import solve  # noqa: E402
from lcp_lube.base.files import replacing  # noqa: E402
from lcp_lube.output.style import BLUE, GREY, RED, STYLE, new_figure  # noqa: E402
from lcp_lube.problems.solution import Solution  # noqa: E402
from lcp_lube.scenes.scene import load_scene  # noqa: E402

LOOKS = ({"color": BLUE, "marker": "o"}, {"color": RED, "marker": "s"})


def solved(n: int) -> Solution:
    """The line contact with n unknowns, ||H|| measured as the paper prints it; a run that fails ends the script."""
    solution = solve(load_scene("ehl_line", {"n": n, "rows": "divergence"}), stopping={"eps1": 1e-8, "eps2": np.inf})
    if not solution.converged:
        raise SystemExit(f"ehl_line, n = {n}: {solution.message}")
    return solution


def convergence(solutions: list[Solution]) -> Figure:
    """Figure 1: ||H|| by iteration, and its quotients, which fall to zero where convergence is superlinear."""
    figure = new_figure(9.0, 3.6)
    left, right = figure.subplots(1, 2)
    for solution, look in zip(solutions, LOOKS, strict=True):
        n, norms = solution.problem.unknowns, np.array([step.norm for step in solution.steps])
        quotients = norms[1:] / norms[:-1]
        its = np.arange(1, norms.size + 1)
        left.semilogy(its, norms, ms=4, lw=1.4, label=f"n = {n}", **look)
        right.semilogy(its[1:], quotients, ms=4, lw=1.4, label=f"n = {n}", **look)
        last = ", ".join(f"{quotient:.1e}" for quotient in quotients[-5:])
        print(f"figure 1, n = {n}: {norms.size} iterations to ||H|| = {norms[-1]:.2e}; last quotients {last}")
    left.axhline(2e-7, color=GREY, lw=0.8, ls=":")
    left.text(1.0, 2e-7, "order of the printed last $\\Vert H \\Vert$", va="bottom", fontsize=8, color=GREY)
    left.set(xlabel="iteration", ylabel=r"$\Vert H \Vert$")
    right.set(xlabel="iteration k", ylabel=r"$\Vert H_k \Vert\,/\,\Vert H_{k-1} \Vert$")
    left.legend(loc="upper right")
    for axes in (left, right):
        axes.xaxis.get_major_locator().set_params(integer=True)
    return figure


def profile(solution: Solution, name: str) -> Figure:
    """Figure 2, the film beside its part without elastic deformation; or figure 3, the pressure beside its start."""
    problem = solution.problem
    x = problem.grid.x[0]
    values, _ = problem.physical(solution.fields)[name]
    found = problem.quantities(solution.fields)
    figure = new_figure(5.6, 3.6)
    axes = figure.subplots()
    if name == "h":
        axes.plot(x, x**2 + found["k"] + 1.0, color=GREY, ls="--", lw=1.2, label="without the integral, $x^2 + k + 1$")
        axes.plot(x, values, color=BLUE, lw=2.0, label=f"film, least {found['h_min']:.4f}")
        axes.set(ylabel="film h", ylim=(0.0, 10.0))
    else:
        axes.plot(x, np.maximum(1.0 - x**2 / 4.0, 0.0), color=GREY, ls="--", lw=1.2, label="start, $1 - x^2/4$")
        axes.plot(x, values, color=BLUE, lw=2.0, label=f"pressure, largest {found['p_max']:.4f}")
        axes.set(ylabel="pressure p", ylim=(0.0, 1.2))
    axes.axvline(found["x_b"], color=RED, lw=1.0, ls=":", label=f"$x_b$ = {found['x_b']:.4f}")
    axes.set(xlabel="x", xlim=(-3.0, 2.0), title=f"line contact, n = {problem.unknowns}, k = {found['k']:.6f}")
    axes.legend()
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results", help="folder of the pictures")
    args = parser.parse_args()
    args.results.mkdir(parents=True, exist_ok=True)
    solutions = [solved(n) for n in (200, 1000)]
    with mpl.rc_context(STYLE):
        figures = [convergence(solutions), profile(solutions[1], "h"), profile(solutions[1], "p")]
        for number, figure in enumerate(figures, 1):
            with replacing(args.results / f"bergamaschi_zilli_figure{number}.png", MPI.COMM_WORLD) as temporary:
                figure.savefig(temporary, dpi=130)
    for solution in solutions:
        solution.destroy()


if __name__ == "__main__":
    main()
