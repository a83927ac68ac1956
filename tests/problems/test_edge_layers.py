"""What faces beside a slanted edge gain is what lattices of faces lack along it, at any slope, shape of cells and contrast."""

from math import gcd

import numpy as np
import pytest
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import splu

from lcp_lube import load_scene, solve
from lcp_lube.problems.film.edge_layers import REACH, beside_edge, gain, layer


class Lattice:
    """A torus of nx by ny points, 1 and dy apart, half of it thick, in a stripe that goes round it once each way."""

    def __init__(self, nx, ny, dy, thick):
        self.shape, self.dy, self.thick = (nx, ny), dy, thick
        self.slopes = np.array([1.0 / nx, 1.0 / (ny * dy)])
        self.size = np.hypot(*self.slopes)
        self.normal = self.slopes / self.size
        self.x, self.y = np.meshgrid(np.arange(nx) * 1.0, np.arange(ny) * dy)

    def distance(self, x, y):
        """To the nearest edge, negative in the stripe."""
        at = np.mod(self.slopes[0] * x + self.slopes[1] * y + 0.1234567, 1.0)
        return np.where(at < 0.5, -np.minimum(at, 0.5 - at), np.minimum(at - 0.5, 1.0 - at)) / self.size

    def series(self, x, y, step):
        """Conductances of lines of this length from these points on, of resistances in series."""
        at, to = (self.slopes[0] * x + self.slopes[1] * y + 0.1234567 + more for more in (0.0, step))
        before, behind = (np.floor(one) * 0.5 + np.minimum(one - np.floor(one), 0.5) for one in (at, to))
        share = (behind - before) / step
        return 1.0 / (share / self.thick**3 + 1.0 - share)

    def lacks(self, law):
        """Conduction along an edge, and resistance across it, more than of the film itself, a length of edge."""
        (nx, ny), (slope_x, slope_y), dy = self.shape, self.slopes, self.dy
        kx, ky = self.series(self.x, self.y, slope_x), self.series(self.x, self.y, slope_y * dy)
        if law:
            for k, x, y, along in ((kx, self.x[0] + 0.5, self.y[:, 0], True), (ky, self.x[0], self.y[:, 0] + 0.5 * dy, False)):
                lines, widths = np.ascontiguousarray(y), np.full(ny, dy)
                if along:
                    away, length = beside_edge(self.distance, x, np.ones(nx), lines, widths, True)
                else:
                    turned = lambda t, s: self.distance(s, t)  # noqa: E731
                    away, length = (a.T for a in beside_edge(turned, y, widths, x, np.ones(nx), False))
                h = np.where(self.distance(*np.meshgrid(x, y)) < 0.0, self.thick, 1.0)
                near = np.abs(away) < REACH
                k[near] += layer(self.thick - 1.0, away[near], length[near], h[near])[0]
        kx, ky = kx * dy, ky / dy
        number = np.arange(nx * ny).reshape(ny, nx)
        ends = np.concatenate([np.roll(number, -1, 1).ravel(), np.roll(number, -1, 0).ravel()])
        W = coo_matrix((np.concatenate([kx.ravel(), ky.ravel()]), (np.tile(number.ravel(), 2), ends)), shape=(nx * ny, nx * ny))
        W = (W + W.T).tocsr()
        factors = splu((diags(np.asarray(W.sum(1)).ravel()) - W).tocsc()[1:, 1:])
        tensor = np.zeros((2, 2))
        for k, pushed in enumerate((kx - np.roll(kx, 1, 1), (ky - np.roll(ky, 1, 0)) * dy)):
            p = np.concatenate([[0.0], factors.solve(pushed.ravel()[1:])]).reshape(ny, nx)
            tensor[0, k] = np.sum(kx * ((k == 0) + np.roll(p, -1, 1) - p)) / (nx * ny * dy)
            tensor[1, k] = np.sum(ky * ((k == 1) * dy + np.roll(p, -1, 0) - p)) / (nx * ny)
        along, mean = np.array([-self.normal[1], self.normal[0]]), 0.5 * (self.thick**3 + 1.0)
        across = 0.5 * (self.thick**-3 + 1.0)
        by_length = 0.5 / self.size
        return (along @ tensor @ along - mean) * by_length, (
            self.normal @ np.linalg.inv(tensor) @ self.normal - across
        ) * by_length


@pytest.mark.parametrize("thick", [1.2, 3.0])
@pytest.mark.parametrize("dy", [0.08, 0.4, 1.5])
@pytest.mark.parametrize("slope", [0.13, 0.4, 1.8, 6.7])
def test_lattices_lack_nothing_along_an_edge(thick, dy, slope):
    """In series alone they lack up to a cell of the mean film; resistance across is exact, and stays within a hundredth
    of a cell."""
    nx = max(34, round(np.sqrt(3000 / slope)))
    ny = max(34, round(nx * slope))
    while gcd(nx, ny) > 1:
        ny += 1
    lattice = Lattice(nx, ny, dy, thick)
    (before, exact), (now, across) = lattice.lacks(False), lattice.lacks(True)
    assert before < 0.0 and abs(exact) < 1e-9
    assert abs(now) < 0.08 * abs(before)
    cell = np.hypot(lattice.normal[0], lattice.normal[1] * dy)
    assert abs(across) < 0.01 * cell * (1.0 - thick**-3)


def test_gain_is_1_on_a_diagonal_and_does_not_know_the_axes():
    rng = np.random.default_rng(1)
    slant, (dx, dy) = rng.uniform(0.01, 1.56, 500), np.exp(rng.uniform(-3, 3, (2, 500)))
    n_x, n_y = np.cos(slant), np.sin(slant)
    one, other = gain(n_x**2, n_y**2, n_x * dx, n_y * dy), gain(n_y**2, n_x**2, n_y * dy, n_x * dx)
    np.testing.assert_allclose(one, other, rtol=1e-10)
    assert (one > 0.999).all()
    np.testing.assert_allclose(gain(n_x**2, n_y**2, np.ones(500), np.ones(500)), 1.0, atol=1e-2)
    lying = gain(np.array([0.0, 1.0]), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([1.0, 0.0]))
    assert np.isfinite(lying).all()


def test_every_face_keeps_more_than_half_of_its_conductance():
    """Whatever the edge's depth, slope and cells: matrices stay those of the theorem, and H goes to the film's other side."""
    rng = np.random.default_rng(5)
    h, depth, dx, dy = np.exp(rng.uniform(-3, 3, (4, 10_000)))
    slant, away = rng.uniform(0.0, np.pi / 2, 10_000), rng.uniform(-1.5, 1.5, 10_000)
    a, b = np.cos(slant) * dx, np.sin(slant) * dy
    length = (np.sin(slant) ** 2 * a + np.cos(slant) ** 2 * b) / np.hypot(a, b)
    length *= gain(np.cos(slant) ** 2, np.sin(slant) ** 2, a, b)
    h = np.where(away < 0.0, h + depth, h)
    more, slope = layer(depth, away, length, h)
    assert (more > -0.5 * h**3).all() and (more[away < 0.0] >= 0.0).all() and (more[away > 0.0] <= 0.0).all()
    other = h + np.where(away < 0.0, -depth, depth)
    np.testing.assert_allclose(h + slope * (other**3 - h**3), other, rtol=1e-9)
    shallow = layer(1e-6, away, length, np.ones(10_000))[0], layer(2e-6, away, length, np.ones(10_000))[0]
    np.testing.assert_allclose(2.0 * shallow[0], shallow[1], rtol=1e-4)
    steep = layer(1e7, away, length, np.where(away < 0.0, 1e7 + 1.0, 1.0))[0]
    assert np.isfinite(steep).all() and (steep[away > 0.0] > -0.5).all()


@pytest.mark.parametrize(
    "shape, off", [((24, 159), 6e-3), ((48, 319), 3e-3), ((96, 639), 8e-4), ((61, 97), 5e-3), ((97, 61), 3e-3)]
)
def test_spirals_on_cells_of_any_shape(shape, off):
    """A bearing with few spirals, whose cells are seven times as wide as long: with a law for square cells 2.1, 1.0, 0.4 % off
    on the first three grids, of first order."""
    changes = {"pads": 8, "angle_deg": 25.0, "speed_rpm": 1000.0, "p_inner": 3e5, "p_outer": 3e5}
    with solve(load_scene("spiral_groove", changes).with_shape(shape)) as solution:
        assert solution.numbers["load"] == pytest.approx(870.6, rel=off)  # of 400 x 500 and 310 x 400 points: 870.5, 870.7
