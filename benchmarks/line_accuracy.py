"""Accuracy in one dimension, scheme face: errors of the numbers and of the fields on any grid (docs/accuracy.md).

python benchmarks/line_accuracy.py
"""

import numpy as np

from lcp_lube import load_scene, solve

SCENES = ("problem1", "problem2", "problem3", "parabolic_slider", "pocketed_pad", "long_journal")
GRIDS = (12, 50, 100, 200)


def main() -> None:
    print(f"{'scene':17} {'n':>4} {'load':>8} {'p_max':>8} {'flow':>8} {'rupture':>8} {'reform.':>8}  p at the points")
    for name in SCENES:
        for n in GRIDS:
            scene = load_scene(name, {"n": n, "scheme": "face"})
            exact = scene.exact()
            solution = solve(scene, method="active-set", nested=False, stopping={"eps1": 1e-12})
            found, problem = solution.numbers, solution.problem
            L, p = problem.grid.lengths[0], solution.fields["p"] * problem.p_unit
            errors = [
                found["pressure_integral"] / exact.load - 1,
                (found["p_max"] - problem.p_c) / exact.p_max - 1,
                2 * found["flow"]["east"] / exact.Q - 1,
                *(
                    (found[key] - getattr(exact, key)) / L if found[key] is not None else np.nan
                    for key in ("rupture", "reformation")
                ),
            ]
            field = np.max(np.abs(p - exact.p(problem.grid.x[0]))) / exact.p_max
            print(f"{name:17} {n:4} " + " ".join(f"{abs(error):8.1e}" for error in errors) + f"  {field:8.1e}", flush=True)
            solution.destroy()


if __name__ == "__main__":
    main()
