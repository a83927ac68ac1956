"""Bands of films whose supplies' pressures follow, and of rings: they hold the exact discrete solution, found in rationals."""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest

from lcp_lube.api import solve
from lcp_lube.problems.film.flows import volume_unit
from lcp_lube.solvers.enclosure import way_out


def scene(ring, supplies, turned, shape=(10, 5), e=0.7):
    """A journal's film with some supplies, open or closed to a ring."""
    sides = {"west": "periodic", "east": "periodic"} if ring else {"west": 2e5, "east": 1e5}
    film = {"shape": "formula", "h": f"100*(1 - {e}*cos(x/0.05 - {turned}))", "unit": "um"}
    fluid = {"mu": 0.02, "p_supply": 1e5}
    data = {"family": "bearing", "dimension": 2, "L": 0.1 * np.pi, "width": 0.05, "U": 10.0, "nx": shape[0], "ny": shape[1]}
    return data | {"fluid": fluid, "sides": sides, "film": [film], "supply": supplies}


def exact(problem, fields, pinned=None):
    """p and r in rationals, from the computed answer's signs; P_s is one unknown, its equation the sum of its cells' balances.

    pinned : the one supply's pressure (p_unit), given instead; then what it gives to the film there is returned, m3/s.
    """
    s, (ny, nx), held = problem.scheme, problem.grid.box, problem.held
    owner = held.owner.ravel() if held else np.full(nx * ny, -1)
    count, unit = len(held.supplies) if held else 0, Fraction(volume_unit(problem))
    n, p_unit = nx * ny, Fraction(problem.p_unit)
    sides = [Fraction(side / problem.p_unit) for side in problem.p_sides]
    cavity = ((fields["r"] > fields["p"]) & (owner < 0)).tolist()
    M, f = [[Fraction(0)] * (n + count) for _ in range(n + count)], [Fraction(0)] * (n + count)
    for row in range(n):
        j, i = divmod(row, nx)
        to = row if owner[row] < 0 else n + int(owner[row])
        for way, (k, dj, di) in enumerate(((s.k_W, 0, -1), (s.k_E, 0, 1), (s.k_S, -1, 0), (s.k_N, 1, 0))):
            at = (j + dj, (i + di) % nx if problem.grid.periodic[0] else i + di)
            inside, k = 0 <= at[0] < ny and 0 <= at[1] < nx, Fraction(k[j, i])
            beside = at[0] * nx + at[1] if inside else None
            if not cavity[row]:
                M[to][row if owner[row] < 0 else to] += k
            if inside and not cavity[beside]:
                M[to][beside if owner[beside] < 0 else n + int(owner[beside])] -= k
            elif not inside and owner[row] >= 0:
                f[to] += k * sides[way]
            if way == 0 and inside and cavity[beside]:
                M[to][beside] -= Fraction(s.b_W[j, i])  # unknown: -r
        if owner[row] < 0:
            f[to] += Fraction(s.c[j, i])
            if cavity[row]:
                M[to][row] -= Fraction(s.b_C[j, i])
        else:
            f[to] += Fraction(s.couette_W[j, i]) - Fraction(s.couette_E[j, i])
            M[row][row], M[row][to] = Fraction(1), Fraction(-1)
    for k, one in enumerate(held.supplies if held else ()):
        row, R0, R1 = n + k, Fraction(0), Fraction(0)  # the source gives R0 - R1 P
        if pinned is not None:
            balance, given = M[row], f[row]
            M[row], f[row] = [Fraction(int(at == row)) for at in range(n + count)], pinned
            y = eliminate([each[:] for each in M], f[:])
            return unit * (sum(a * b for a, b in zip(balance, y, strict=True)) - given)
        if one.flow is not None:
            R0 = Fraction(one.flow)
        else:
            R0, R1 = Fraction(one.K) * Fraction(one.p_s), Fraction(one.K) * p_unit
        M[row][row] += R1 / unit
        f[row] += R0 / unit
    y = eliminate(M, f)
    assert all((value < 0) == empty for value, empty in zip(y, cavity, strict=False)), "the computed signs are the exact ones"
    return [max(v, Fraction(0)) for v in y[:n]], [max(-v, Fraction(0)) for v in y[:n]]


def eliminate(M, b):
    """Gauss; sums of an M-matrix's rows need no pivots, but held cells stand before their pressures."""
    n = len(b)
    for k in range(n):
        at = next(i for i in range(k, n) if M[i][k])
        M[k], M[at], b[k], b[at] = M[at], M[k], b[at], b[k]
        for i in range(k + 1, n):
            if M[i][k]:
                factor = M[i][k] / M[k][k]
                b[i] -= factor * b[k]
                M[i] = [a - factor * c if c else a for a, c in zip(M[i], M[k], strict=True)]
    for k in reversed(range(n)):
        b[k] = (b[k] - sum(M[k][j] * b[j] for j in range(k + 1, n) if M[k][j])) / M[k][k]
    return b


def assert_inside(solution):
    found, (p, r) = solution.enclosure, exact(solution.problem, solution.fields)
    assert found.certified, found.message
    for k in range(len(p)):
        assert Fraction(found.lower["p"][k]) <= p[k] <= Fraction(found.upper["p"][k])
        assert Fraction(found.upper["r"][k]) <= r[k] <= Fraction(found.lower["r"][k])
    off = max(abs(Fraction(a) - b) for a, b in zip(solution.fields["p"].tolist(), p, strict=True))
    assert off * Fraction(solution.problem.p_unit) <= Fraction(found.bounds["band_p"])
    assert 0 < found.bounds["band_p_max"] <= found.bounds["band_p"] < 1e-9 * solution.numbers["p_max"]


SOURCES = {
    "capillary": {"restrictor": "capillary", "K": 2e-12, "p_s": 3e6, "backflow": True},
    "flow": {"flow": 4e-6},
}
PLACES = [{"x": (0.06, 0.13), "y": (0.01, 0.03)}, {"x": (0.2, 0.27), "y": (0.018, 0.045)}]


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("turned", [0.3, 2.0, 4.4])
@pytest.mark.parametrize("sources", [("capillary",), ("flow",), ("capillary", "capillary"), ()], ids="-".join)
def test_the_band_holds_the_exact_solution(ring, turned, sources):
    supplies = [SOURCES[name] | place for name, place in zip(sources, PLACES, strict=False)]
    solution = solve(scene(ring, supplies, turned), certify=True)
    if solution.converged:
        assert_inside(solution)
    else:
        assert not solution.enclosure.certified and "more than its source gives" in solution.message
    solution.destroy()


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("K, backflow", [(2e-9, False), (1e-12, False), (5e-8, False)])
def test_an_orifices_pressure_lies_between_the_bands_ends(ring, K, backflow):
    """At the lower end the film takes less than the orifice gives, at the upper one more; both grow, or fall, with P."""
    supply = {"restrictor": "orifice", "K": K, "p_s": 3e6, "backflow": backflow} | PLACES[0]
    solution = solve(scene(ring, [supply], 2.0), certify=True)
    assert solution.converged and solution.enclosure.certified, solution.message
    problem, held = solution.problem, solution.problem.held.mask.ravel()
    for end, sign in ((solution.enclosure.lower, -1), (solution.enclosure.upper, 1)):
        (P,) = {Fraction(value) for value in end["p"][held].tolist()}
        with localcontext() as context:
            context.prec = 60
            over = Fraction(supply["p_s"]) - P * Fraction(problem.p_unit)
            given = Fraction(Decimal(K) * (Decimal(over.numerator) / Decimal(over.denominator)).sqrt())
        assert sign * (exact(problem, solution.fields, P) - given) > 0
    solution.destroy()


@pytest.mark.parametrize("words", ["hybrid_journal --nx 96", "ring_journal --nx 72 --ny 15"])
def test_on_several_ranks(cli, words):
    one, three = (cli("solve", *words.split(), "--certify", "--json", ranks=ranks).json for ranks in (1, 3))
    assert one["certified"] and three["certified"], (one["certified_message"], three["certified_message"])
    assert max(one["band_p"], three["band_p"]) < 1e-8 * one["p_max"]


def test_a_ring_with_a_line_that_may_be_empty_has_no_band():
    solution = solve(scene(True, [], 2.0))
    problem, lower = solution.problem, {"p": np.ones(50)}
    assert way_out(problem, lower) == ""
    lower["p"][20:30] = 0.0
    assert "a line may be cavitated all the way" in way_out(problem, lower)
    solution.destroy()
    solution = solve(scene(True, [{"p": 2e5} | PLACES[0]], 2.0) | {"sides": dict.fromkeys(("west", "east"), "periodic")
                     | dict.fromkeys(("south", "north"), "closed")}, certify=True)  # fmt: skip
    assert not solution.enclosure.certified and "no side across it is open" in solution.enclosure.message
    solution.destroy()
