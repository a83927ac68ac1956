"""Public test problems of mixed complementarity, transcribed from the literature: l <= x <= u and F(x).

Most stand in MCPLIB (Dirkse and Ferris, Optim. Methods Softw. 5 (1995) 319), as GAMS models and, many of them, as AMPL models
by Ferris, Fourer and Gay. Bounds, data and starting points are the published ones. F takes complex arguments: Jacobians are
complex-step derivatives, exact to rounding, so that F is all that was transcribed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp

Vector = np.ndarray
INF = np.inf


def complex_step(F: Callable[[Vector], Vector]) -> Callable[[Vector], Vector]:
    """The Jacobian of F."""

    def J(x: Vector) -> Vector:
        shift = 1e-30
        return np.stack([F(x + shift * 1j * e).imag for e in np.eye(x.size)], axis=1) / shift

    return J


@dataclass(frozen=True)
class Case:
    """One problem: its data, its published starting points, and what is known of its solutions.

    check tells whether x is a known solution, to the digits that are published.
    """

    F: Callable[[Vector], Vector]
    lower: Vector
    upper: Vector
    starts: dict[str, Vector]
    J: Callable[[Vector], Any]
    check: Callable[[Vector], bool] = field(default=lambda x: True)


def ncp(F: Callable[[Vector], Vector], starts: list[Any], check: Callable[[Vector], bool] = lambda x: True) -> Case:
    """x >= 0 and F(x) >= 0, complementary."""
    points = {str(k): np.array(x, dtype=float) for k, x in enumerate(starts, 1)}
    n = points["1"].size
    return Case(F, np.zeros(n), np.full(n, INF), points, complex_step(F), check)


def near(*solutions: Any, digits: float = 1e-4) -> Callable[[Vector], bool]:
    """Whether x is one of these solutions."""
    return lambda x: any(np.allclose(x, solution, rtol=digits, atol=digits) for solution in solutions)


def billups() -> Case:
    """Billups's one-dimensional trap: a local minimum of the merit functions at the start (thesis, Wisconsin 1995)."""
    return ncp(lambda x: (x - 1.0) ** 2 - 1.01, [[0.0]], near([1.0 + np.sqrt(1.01)]))


# Starting points of both Kojima problems in MCPLIB.
KOJIMA_STARTS = [
    [0, 0, 0, 0], [1, 1, 1, 1], [100, 100, 100, 100], [1, 0, 1, 0],
    [1, 0, 0, 0], [0, 1, 1, 0], [0, 1, 0, 1], [1.25, 0, 0, 0.5],
]  # fmt: skip


def kojima(to_x3: float, c3: float) -> Callable[[Vector], Vector]:
    """F of Kojima's problem in four unknowns, whose two versions differ in the second and the third function."""

    def F(x: Vector) -> Vector:
        a, b, c, d = x
        third = (9.0 if c3 == 9.0 else 3.0) * d
        return np.array(
            [
                3 * a**2 + 2 * a * b + 2 * b**2 + c + 3 * d - 6,
                2 * a**2 + a + b**2 + to_x3 * c + 2 * d - 2,
                3 * a**2 + a * b + 2 * b**2 + 2 * c + third - c3,
                a**2 + 3 * b**2 + 2 * c + 3 * d - 3,
            ]
        )

    return F


def josephy() -> Case:
    """Kojima's problem as Josephy has it; one solution (MRC report 1965, Wisconsin 1979)."""
    return ncp(kojima(3.0, 1.0), KOJIMA_STARTS, near([np.sqrt(1.5), 0, 0, 0.5]))


def kojshin() -> Case:
    """Kojima and Shindo, J. Oper. Res. Soc. Japan 29 (1986) 352: two solutions, the first degenerate (x_3 = F_3 = 0)."""
    return ncp(kojima(10.0, 9.0), KOJIMA_STARTS, near([np.sqrt(1.5), 0, 0, 0.5], [1, 0, 3, 0]))


def cournot(
    c: list[float], beta: list[float], unit_cost: Callable[[Vector], Vector], gamma: float
) -> Callable[[Vector], Vector]:
    """F of a Nash-Cournot oligopoly: marginal cost c + unit_cost^(1/beta) against price (5000/Q)^(1/gamma) and its slope."""

    def F(q: Vector) -> Vector:
        Q = np.sum(q)
        price = (5000.0 / Q) ** (1.0 / gamma)
        return np.array(c) + unit_cost(q) ** (1.0 / np.array(beta)) - price + q * price / (gamma * Q)

    return F


def nash5() -> Case:
    """Five firms (Murphy, Sherali and Soyster, Math. Program. 24 (1982) 92)."""
    F = cournot([10, 8, 6, 4, 2], [1.2, 1.1, 1.0, 0.9, 0.8], lambda q: q / 5.0, 1.1)
    return ncp(F, [np.ones(5), np.full(5, 10.0)], near([36.933, 41.818, 43.707, 42.659, 39.179]))


def nash10() -> Case:
    """Ten firms (Harker, Math. Program. 41 (1988) 29), as MCPLIB has it."""
    F = cournot([5, 3, 8, 5, 1, 3, 7, 4, 6, 3], [1.2, 1.0, 0.9, 0.6, 1.5, 1.0, 0.7, 1.1, 0.95, 0.75], lambda q: 10.0 * q, 1.2)
    ladder = [1.0, 1.2, 1.4, 1.6, 1.8, 2.1, 2.3, 2.5, 2.7, 2.9]
    rounded = [7, 4, 3, 1, 18, 4, 1, 6, 3, 2]
    return ncp(F, [np.ones(10), np.full(10, 10.0), ladder, rounded], near(rounded, digits=0.5))


def explcp() -> Case:
    """Murty's linear problem on which Lemke's pivoting takes 2^n steps, n = 16."""
    M = np.eye(16) + 2.0 * np.triu(np.ones((16, 16)), 1)
    return ncp(lambda x: M @ x - 1.0, [np.zeros(16)], near(np.eye(16)[-1], digits=1e-9))


def munson1() -> Case:
    """Munson's linear problem in three unknowns; infinitely many solutions."""
    M = np.array([[1, 2, 3], [0, 1, -1], [1, 1, 0]])
    return ncp(lambda x: M @ x - [1.0, -1.0, -1.0], [np.zeros(3)])


def mathiesen() -> Case:
    """Mathiesen's Walrasian equilibrium, modified; solutions (t, 0, 0, 0), 0 <= t <= 3 (Kanzow 1994, and others)."""

    def F(x: Vector) -> Vector:
        a, b, c, d = x
        return np.array([-b + c + d, a - (4.5 * c + 2.7 * d) / (b + 1), 5 - a - (0.5 * c + 0.3 * d) / (c + 1), 3 - a])

    return ncp(F, [np.ones(4), np.full(4, 10.0)], lambda x: bool(np.allclose(x[1:], 0, atol=1e-6) and -1e-6 < x[0] < 3 + 1e-6))


def transport() -> Case:
    """Dantzig's two canneries and three markets as an equilibrium (GAMS's transmcp); the cost is 153.675."""
    cost = 0.09 * np.array([[2.5, 1.7, 1.8], [2.5, 1.8, 1.4]])
    supply, demand = np.array([350.0, 600.0]), np.array([325.0, 300.0, 275.0])

    def F(v: Vector) -> Vector:
        x, w, p = v[:6].reshape(2, 3), v[6:8], v[8:]
        return np.concatenate([(w[:, None] + cost - p).ravel(), supply - x.sum(axis=1), x.sum(axis=0) - demand])

    return ncp(F, [np.zeros(11)], lambda v: bool(abs(np.sum(cost * v[:6].reshape(2, 3)) - 153.675) < 1e-6))


def choi() -> Case:
    """Prices of 14 brands of pain killers in a Nash equilibrium (Choi, DeSarbo and Harker 1990); one price is fixed."""
    from mcplib_data import CHOI_BRANDS, CHOI_SUBJECTS

    x, c = CHOI_BRANDS[:, :4], CHOI_BRANDS[:, 4]
    y, v, b, w0 = CHOI_SUBJECTS[:, :4], CHOI_SUBJECTS[:, 4], CHOI_SUBJECTS[:, 5], CHOI_SUBJECTS[:, 6]
    chi, K = 3.0, 1.0
    w = -chi * w0
    utility = -chi * (v[:, None] * ((x[None] - y[:, None]) ** 2).sum(axis=2) + b[:, None])

    def F(p: Vector) -> Vector:
        e = np.exp(w[:, None] * p + utility)
        total = K + e.sum(axis=1, keepdims=True)
        return -np.mean(e / total * (1 + (p - c) * w[:, None] * (total - e) / total), axis=0)

    lower, upper = c.copy(), np.full(14, INF)
    lower[7] = upper[7] = 0.199
    return Case(F, lower, upper, {"1": c + 0.01}, complex_step(F))


def pies() -> Case:
    """The PIES energy model (Hogan 1975; Josephy 1979): a linear program with prices in its demands, 42 unknowns."""
    rmax, rcost = np.array([35000.0, 12000.0]), np.array([6.5, 5.0])
    cmax = np.array([[300.0, 300, 400], [200, 300, 600]])
    omax = np.array([[1100.0, 1200], [1300, 1100]])
    q0, p0 = np.array([1000.0, 1200, 1000]), np.array([12.0, 16, 12])
    light, heavy = np.array([0.6, 0.5]), np.array([0.4, 0.5])
    esub = np.array([[-0.75, 0.1, 0.2], [0.1, -0.5, 0.2], [0.2, 0.1, -0.5]])
    cruse = np.array([[[1.0, 5, 10], [1, 5, 6]], [[1, 2, 3], [1, 4, 5]]])  # resource, region, increment
    oruse = np.array([[[0.0, 10], [0, 15]], [[0, 4], [0, 2]]])
    ccost, ocost = np.array([[5.0, 6, 8], [4, 5, 7]]), np.array([[1.0, 1.5], [1.25, 1.5]])
    ctcost, otcost = np.array([[1.0, 2.5], [0.75, 2.75]]), np.array([[2.0, 3], [4, 2]])
    ltcost = htcost = np.array([[1.0, 1.2], [1.0, 1.5]])
    # coal, oil, their transport and that of light and heavy oil, prices, and the duals mu, cv, ov, lv, hv
    shapes = [(2, 3), (2, 2), (2, 2), (2, 2), (2, 2), (2, 2), (3, 2), (2,), (2,), (2,), (2,), (2,)]
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])

    def F(v: Vector) -> Vector:
        c, o, ct, ot, lt, ht, p, mu, cv, ov, lv, hv = (
            part.reshape(shape) for part, shape in zip(np.split(v, ends[:-1]), shapes, strict=True)
        )
        demand = q0[:, None] * np.prod((p / p0[:, None])[None] ** esub[:, :, None], axis=1)
        parts = [
            ccost + np.tensordot(mu, cruse, 1) - cv[:, None],
            ocost + np.tensordot(mu, oruse, 1) - ov[:, None],
            ctcost + cv[:, None] - p[0],
            otcost + rcost + ov[:, None] - light * lv - heavy * hv,
            ltcost + lv[:, None] - p[1],
            htcost + hv[:, None] - p[2],
            np.stack([ct.sum(axis=0), lt.sum(axis=0), ht.sum(axis=0)]) - demand,
            rmax - np.tensordot(cruse, c, 2) - np.tensordot(oruse, o, 2),
            c.sum(axis=1) - ct.sum(axis=1),
            o.sum(axis=1) - ot.sum(axis=1),
            ot.sum(axis=0) * light - lt.sum(axis=1),
            ot.sum(axis=0) * heavy - ht.sum(axis=1),
        ]
        return np.concatenate([np.ravel(part) for part in parts])

    low = [0.0] * 26 + [0.1] * 6 + [0.0] * 2 + [-INF] * 8
    high = [*cmax.ravel(), *omax.ravel(), *[INF] * 32]
    prices = [11.7, 13.7, 15.8, 16.0, 11.9, 12.4]
    start = [300.0, 300, 400, 200, 300, 600, 1100, 1000, 1300, 1000, 0, 828, 1016, 84, 2075, 0, 0, 2358]
    start += [22, 1223, 1179, 0, 0, 830, 998, 180, *prices, *[1] * 10]
    # The prices at the start are the solution's, rounded to the printed digits.
    check = lambda v: bool(np.allclose(v[26:32], prices, atol=0.06))  # noqa: E731
    return Case(F, np.array(low), np.array(high), {"1": np.array(start, dtype=float)}, complex_step(F), check)


def laplacian(n: int) -> sp.csr_array:
    """The five-point matrix (4, -1) on n x n points."""
    line = sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    return sp.csr_array(sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line))


def obstacle() -> Case:
    """A membrane pushed up between two bumpy obstacles on 50 x 50 points (Ciarlet; MCPLIB); J is sparse."""
    n = 50
    d = 1.0 / (n + 1)
    x, y = np.meshgrid(*2 * [np.arange(1, n + 1) * d], indexing="ij")
    bump = (np.sin(9.2 * x) * np.sin(9.3 * y)).ravel()
    A, lower = laplacian(n), bump**3
    return Case(lambda v: A @ v - d * d, lower, bump**2 + 0.2, {"1": np.maximum(lower, 0.0)}, lambda v: A)


BALL_RADIUS, BALL_A, BALL_B = 0.697965148223374, 0.680259411891719, 0.471519893402112


def ball() -> Case:
    """A membrane over a ball, exact solution known (PETSc's snes/tutorials/ex9, Bueler), on 63 x 63 points of [-2, 2]^2."""
    n = 63
    d = 4.0 / (n + 1)
    axis = -2.0 + d * np.arange(n + 2)
    r = np.hypot(*np.meshgrid(axis, axis, indexing="ij"))
    cap = np.sqrt(1.0 - np.minimum(r, 0.9) ** 2)
    psi = np.where(r <= 0.9, cap, np.sqrt(0.19) - 0.9 / np.sqrt(0.19) * (r - 0.9))  # from radius 0.9 its tangent cone
    exact = np.where(r <= BALL_RADIUS, psi, BALL_B - BALL_A * np.log(np.maximum(r, BALL_RADIUS)))
    inside = exact[1:-1, 1:-1].ravel()
    edge = exact.copy()
    edge[1:-1, 1:-1] = 0.0
    boundary = (edge[:-2, 1:-1] + edge[2:, 1:-1] + edge[1:-1, :-2] + edge[1:-1, 2:]).ravel()
    A, lower, radius = laplacian(n), psi[1:-1, 1:-1].ravel(), r[1:-1, 1:-1].ravel()

    def check(v: Vector) -> bool:
        contact = A @ v - boundary > v - lower
        return bool(abs(radius[contact].max() - BALL_RADIUS) < d and np.abs(v - inside).max() < 0.5 * d * d)

    return Case(lambda v: A @ v - boundary, lower, np.full(n * n, INF), {"1": np.maximum(lower, 0.0)}, lambda v: A, check)


CASES: dict[str, Callable[[], Case]] = {
    case.__name__: case
    for case in (billups, josephy, kojshin, nash5, nash10, explcp, munson1, mathiesen, transport, choi, pies, obstacle, ball)
}
