"""What faces beside an edge that runs across the lines of points conduct more, or less, for what flows along it.

Resistances in series on the lines of points (`edges`) are exact for what flows across an edge, as the pressure there depends on
the distance to it alone. Along it they lead too little, by D a length of edge: faces that the edge cuts have the logarithmic
mean of K_1 and K_2 on average, K = h^3, and should have the arithmetic one; and what flows is pressed from line to line:

    D = (K_mean - K_log) (n_y^2 a + n_x^2 b) g,    a = |n_x| dx, b = |n_y| dy,
    g = 1 + (3/pi) s sqrt(m)/(1 + m s^2) Int_0^oo (m Y - X/m)^2/(s X + Y/s) t^-4 dt,
    X = sin(t sqrt(m))^2, Y = sin(t/sqrt(m))^2, m = a/b, s = dy/dx,

n the edge's normal. That is the second order of a perturbation in the contrast, on a lattice that the edge crosses anywhere
(docs/accuracy.md): with K_2/K_1 from 1.5 to 27 it leaves 0 to 8 % of the D that lattices have.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ...base.parallel import Array

Shape = Callable[[Array, Array], Array]
REACH, FAR = 1.5, 4.0  # cells from an edge to where it changes faces; that far, by both widths, it is looked for
STEP = 1e-3  # of a cell, for the distance's slopes
MOST, NODES = (20.0, 64.0), (25, 33)  # m and s that g is tabulated to, and by how many values of their logarithms each
TERMS = 200  # of the integral
WEAK = 1e-3  # contrast below which its first power is enough


def beside_edge(rim: Shape, t: Array, d: Array, lines: Array, widths: Array, along_flow: bool) -> tuple[Array, Array]:
    """How far faces lie from a slanted edge, in cells, negative inside; and the length by which `layer` conducts, in cells."""
    t, s = np.broadcast_arrays(t[None, :], lines[:, None])
    away, length = np.full(t.shape, np.inf), np.zeros(t.shape)
    found = rim(t, s)
    j, i = np.nonzero(np.abs(found) < FAR * (d[None, :] + widths[:, None]))
    t, s, d, w = t[j, i], s[j, i], d[i], widths[j]
    n_t, n_s, by_t, by_s = normal_of(rim, t, d, s, w, along_flow)
    cell = np.hypot(by_t, by_s)
    cell = np.where(cell > 0.0, cell, np.inf)
    away[j, i] = found[j, i] / cell
    length[j, i] = (n_s * by_t + n_t * by_s) / cell * gain(n_t, n_s, by_t, by_s)
    return away, length


def normal_of(rim: Shape, t: Array, d: Array, s: Array, w: Array, along_flow: bool) -> tuple[Array, Array, Array, Array]:
    """Squares of an edge's normal along t and along s; and by how much the distance grows over a cell each way, without sign.

    Where the edge has a fold the slopes are those of either side, not the mean of both.
    """
    here = rim(t, s)

    def grows(t_step: Any, s_step: Any) -> Array:
        ways = [np.abs(rim(t + way * t_step, s + way * s_step) - here) / STEP for way in (-1.0, 1.0)]
        return np.maximum(*(np.nan_to_num(one, nan=0.0, posinf=0.0) for one in ways))

    with np.errstate(invalid="ignore"):
        by_t, by_s = grows(STEP * d, 0.0), grows(0.0, STEP * w)
    # y is a length, x in a sector is not: the normal's parts by the former.
    n_y = np.minimum((by_s / w if along_flow else by_t / d) ** 2, 1.0)
    return (1.0 - n_y, n_y, by_t, by_s) if along_flow else (n_y, 1.0 - n_y, by_t, by_s)


@cache
def _gains() -> tuple[Array, Array, Array]:
    """log m, log s and g at their nodes."""
    log_m, log_s = (np.linspace(-np.log(most), np.log(most), nodes) for most, nodes in zip(MOST, NODES, strict=True))
    m, s = np.exp(log_m)[:, None, None], np.exp(log_s)[None, :, None]
    u = (np.arange(TERMS) + 0.5) / TERMS  # the midpoint rule in u = t/(t + 1), t in parts of the faster sine's length
    unit = 3.0 / np.maximum(m, 1.0 / m) ** 0.5
    t, weight = unit * u / (1.0 - u), unit / (1.0 - u) ** 2 / TERMS
    X, Y = np.sin(t * m**0.5) ** 2, np.sin(t / m**0.5) ** 2
    inside = (m * Y - X / m) ** 2 / (s * X + Y / s) / t**4
    return log_m, log_s, 1.0 + (3.0 / np.pi) * (s * m**0.5 / (1.0 + m * s * s))[..., 0] * np.sum(inside * weight, axis=-1)


def gain(n_t: Array, n_s: Array, a: Array, b: Array) -> Array:
    """g, from the squares of the normal's parts and by how much the distance grows over a cell each way."""
    log_m, log_s, table = _gains()
    with np.errstate(divide="ignore", invalid="ignore"):
        m = np.log(a) - np.log(b)
        s = 0.5 * (np.log(n_t) - np.log(n_s)) - m  # n_x/n_y = m s
    place = []
    for at, nodes in ((m, log_m), (s, log_s)):
        at = (np.clip(np.nan_to_num(at, nan=0.0), nodes[0], nodes[-1]) - nodes[0]) / (nodes[1] - nodes[0])
        k = np.minimum(at.astype(int), nodes.size - 2)
        place.append((k, at - k))
    (i, x), (j, y) = place
    return (1.0 - x) * ((1.0 - y) * table[i, j] + y * table[i, j + 1]) + x * (
        (1.0 - y) * table[i + 1, j] + y * table[i + 1, j + 1]
    )


def layer(depth: float, away: Array, length: Array, h: Array) -> tuple[Array, Array]:
    """What an edge adds to C of the faces about a cell away from it, and dH/dC.

    The thick side gains D K_2^2/(K_2^2 - K_1^2), and the thin one loses what leaves the flow across as it was. H is linear in
    C: what the wall drags along the edge goes with it.

    Parameters
    ----------
    depth : by which the film is thicker at negative distances, m. away : of faces, in cells. length : D over the means'
        difference, in cells. h : film at the faces.
    """
    other = np.where(away < 0.0, h - depth, h + depth)
    K, K_other = h**3, other**3
    c = (K - K_other) / (K + K_other)
    weak = np.abs(c) < WEAK
    safe = np.where(weak, 1.0, c)
    share = 2.0 * K * K_other * np.log(K / K_other) / (K + K_other) ** 2  # (1 - c^2) artanh c, at any contrast
    means = np.where(weak, 2.0 / 3.0 * c, (1.0 - share / safe) / safe)
    hat = np.maximum(0.0, 2.0 - 4.0 * np.abs(np.abs(away) - 1.0))
    return 0.5 * length * means * hat * K * K / (K + K_other), 1.0 / (h * h + h * other + other * other)
