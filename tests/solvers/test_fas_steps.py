"""Multigrid's grids of films with steps: what corrections cost, transposed transfers, pockets with corners between points."""

from itertools import product

import numpy as np
import pytest

pytest.importorskip("numba")

from lcp_lube.base.stages import Stages
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.problems.film.reynolds import box_scheme
from lcp_lube.problems.grid import Grid
from lcp_lube.solvers.fas import steps, transfer
from lcp_lube.solvers.fas.levels import Level, _coarser, restrict
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping


def level_of(nx, ny, ring, conductance):
    """A level whose faces conduct what `conductance(shape)` says, between open or periodic sides."""
    arrays = [np.zeros(shape) for shape in ((ny + 2, nx + 2), (ny + 2, nx + 2), (ny + 2, nx + 3), (ny + 3, nx + 2))]
    level = Level(nx, ny, 0, ny, None, False, ring, *arrays)
    level.kx[1:-1, 1:-1], level.ky[1:-1, 1:-1] = conductance((ny, nx + 1)), conductance((ny + 1, nx))
    for a in (level.kx, level.ky):
        level.share(a)
    return level


def columns(level, coarse, apply):
    """A linear map from a grid's unit vectors, one by one, to the inner points of what it makes of them."""
    made = []
    for k in range(coarse.nx * coarse.ny):
        unit = np.zeros((coarse.ny + 2, coarse.nx + 2))
        unit[1 + k // coarse.nx, 1 + k % coarse.nx] = 1.0
        made.append(apply(coarse.share(unit)).ravel())
    return np.array(made).T


def operator(level):
    def balance(p):
        kx, ky, inner = level.kx, level.ky, p[1:-1, 1:-1]
        out = kx[1:-1, 1:-2] * (inner - p[1:-1, :-2]) + kx[1:-1, 2:-1] * (inner - p[1:-1, 2:])
        return out + ky[1:-2, 1:-1] * (inner - p[:-2, 1:-1]) + ky[2:-1, 1:-1] * (inner - p[2:, 1:-1])

    return columns(level, level, balance)


def transfers(fine, coarse):
    def interpolated(new):
        z = fine.share(np.pad(np.ones((fine.ny, fine.nx)), 1))
        grids = (new, np.zeros_like(new), fine.kx, fine.ky)
        if fine.ways is None:
            transfer.correct(z, *grids, 0, fine.by_x, fine.by_y, True, 0, fine.periodic[0])
        else:
            steps.correct(z, *grids, fine.ways, 0, 0, fine.periodic[0], 1, fine.ny + 1)
        return z[1:-1, 1:-1] - 1.0

    def restricted(c):
        out = np.zeros((coarse.ny + 2, coarse.nx + 2))
        c[[0, -1]], c[:, [0, -1]] = 0.0, 0.0
        restrict(fine, coarse, out, True, c)
        return out[1:-1, 1:-1]

    return columns(fine, coarse, interpolated), columns(coarse, fine, restricted)


# Round a ring an odd number of points is coarsened without what is tested here, between periodic sides of y not at all.
COARSENED = [
    (nx, ny, ring)
    for nx, ny in ((15, 15), (14, 15), (15, 14), (14, 12))
    for ring in product((False, True), repeat=2)
    if not (ring[0] and nx % 2) and not (ring[1] and ny % 2)
]


@pytest.mark.parametrize("nx, ny, ring", COARSENED)
def test_no_correction_costs_less_than_half_of_what_it_should(nx, ny, ring):
    """x' P' A P x <= 2 x' A_H x, with restriction the transposed interpolation, for any conductances."""
    rng = np.random.default_rng(nx + 20 * ny)
    fine = level_of(nx, ny, ring, lambda shape: 1e6 ** rng.random(shape))
    coarse = _coarser(fine, True)
    assert fine.by_x and fine.by_y and fine.ways is not None
    P, R = transfers(fine, coarse)
    np.testing.assert_allclose(R, 0.5 * P.T, rtol=0, atol=1e-14)
    A, A_H = operator(fine), operator(coarse)
    np.testing.assert_allclose(A_H, A_H.T, rtol=0, atol=1e-12 * A_H.max())
    excess = np.linalg.eigvalsh(2.0 * A_H - R @ A @ P)
    assert excess.min() > -1e-10 * excess.max()


@pytest.mark.parametrize("nx, ny", [(7, 9), (15, 12), (17, 31), (31, 8), (63, 63)])
def test_round_a_ring_of_an_odd_number_of_points(nx, ny):
    """Three meshes lie between the last coarse point and the first: transfers are transposed, a balance keeps what goes round,
    and what is smooth costs what it should."""
    rng = np.random.default_rng(nx)
    along = lambda shape: rng.uniform(1.0, 1.2, shape) if shape == (ny, nx + 1) else np.full(shape, (ny / nx) ** 2)  # noqa: E731
    fine = level_of(nx, ny, (True, False), along)
    coarse = _coarser(fine, True)
    assert coarse.nx == nx // 2 and fine.by_x and fine.ways is None
    P, R = transfers(fine, coarse)
    np.testing.assert_allclose(R, (0.5 if fine.by_y else 1.0) * P.T, rtol=0, atol=1e-15)
    A, A_H = operator(fine), operator(coarse)
    np.testing.assert_allclose(A_H, A_H.T, rtol=0, atol=1e-14 * A_H.max())
    inner = (P @ np.ones(P.shape[1])).reshape(ny, nx)[1:-1]  # beside open sides it falls to nothing
    np.testing.assert_allclose(inner, 1.0, rtol=0, atol=1e-14)
    x = np.concatenate(([0.0], np.cumsum(1.0 / fine.kx[1, 2:-1])))  # what one flow makes of every mesh
    turn = 2.0 * np.pi * x[1:nx:2] / (x[-1] + 1.0 / fine.kx[1, 1])
    for wave in (np.sin, np.cos):
        p = (wave(turn[: coarse.nx]) * np.sin(np.pi * np.arange(1, coarse.ny + 1)[:, None] / (coarse.ny + 1))).ravel()
        assert p @ A_H @ p == pytest.approx(p @ R @ A @ P @ p, rel=0.15 if nx > 15 else 0.5)


def test_smooth_corrections_cost_what_they_should():
    """A step along one line: of corrections linear in x or y, away from the sides, the coarse grid's balance is Galerkin's."""
    fine = level_of(31, 31, (False, False), lambda shape: np.where(np.arange(shape[1]) < 16, 1.0, 20.0) * np.ones(shape))
    coarse = _coarser(fine, True)
    assert fine.ways is not None
    P, R = transfers(fine, coarse)
    y, x = np.mgrid[1:16, 1:16]
    for p in (x, y):
        expected, found = R @ operator(fine) @ P @ p.ravel(), operator(coarse) @ p.ravel()
        inner = np.s_[3:-3, [3, 4, 10, 11]]
        np.testing.assert_allclose(found.reshape(15, 15)[inner], expected.reshape(15, 15)[inner], rtol=0, atol=1e-6)


@pytest.mark.parametrize("scheme", ["nodal", "face"])
@pytest.mark.parametrize("p", [0.0, 1e9])
@pytest.mark.parametrize("seed", range(3))
def test_pockets_whose_corners_lie_between_coarse_points(seed, p, scheme):
    """A wedge with 30 pockets of one to three cells, 40 times as deep, full or with cavities: all had been handed over."""
    from lcp_lube.solvers.fas.driver import Fas

    rng, n, L = np.random.default_rng(seed), 150, 0.1
    pockets = [(*rng.uniform(0, L, 2), *rng.uniform(0.5, 1.5, 2) * L / n) for _ in range(30)]

    def film(x, y):
        h = 1e-5 * (2.0 - x / L) + 0 * y
        for a, b, width, height in pockets:
            h = np.where((abs(x - a) < width) & (abs(y - b) < height), 4e-4, h)
        return h

    data = {"mu": 0.015, "U": 1.0, "p_unit": 1e9, "p_sides": (p,) * 4}
    grid = Grid((n, n), (L, L))
    problem = LubricationProblem(grid, box_scheme(grid, film, scheme=scheme, **data), **data, p_c=0.0, film=film)
    run = Fas(Job(problem, Stages(), stopping=Stopping(1e-8)))
    for _ in range(20):
        if run.norm > 1e-8:
            run.advance()  # raises StalledError where there is nothing left to retreat to
    assert run.norm <= 1e-8
