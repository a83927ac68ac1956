"""Supplies whose pressures follow from flows, as unknowns of a step of Newton's method beside the film's.

With Z_t the film's answer to a pressure P_t, at its signs, and Q_s what supply s gives to it,

    z -> z - J^-1 G + sum over t of Z_t dP_t,      Q_s -> Q_s - Q_s'(J^-1 G) + sum over t of Q_s'(Z_t) dP_t,

where the last is in balance with every source, whatever its law: a few equations in dP. That takes one more solve with the
film's factors for each supply.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.film.flows import volume_unit
from ..problems.film.fluid import Law
from ..problems.film.sources import balanced
from ..problems.film.supplies import Supply, supply_flows
from .motions.linearised import Feed, Linear

CONSTANT = Law()
SWEEPS = 16  # of a step's film, where some steps have not settled its signs


def z_of(near: Any, p_unit: float) -> Array:
    """z = p (p_unit), or -r where the film is not full, of a start."""
    p, r = near.fields["p"], near.fields["r"]
    return np.where((r > 0) & ~(p > 0), -r, p * (near.problem.p_unit / p_unit))


class Sources:
    """P : pressures of all, in the film's unknown (q of `fluid`, or p), Pa; like : 2 where half of what the sources feed
    is solved. Collective, as its methods."""

    def __init__(self, supplies: Sequence[Supply], law: Law = CONSTANT, like: int = 1):
        self.supplies, self.law, self.like = tuple(supplies), law, like
        self.free = np.array([one.open for one in supplies], dtype=bool)
        self.any = bool(self.free.any())

    def held(self, P: Array) -> tuple[Supply, ...]:
        """As supplies of given pressures."""
        return tuple(Supply(one.region, float(p)) for one, p in zip(self.supplies, P, strict=True))

    def foreseen(self, film: Any, p: Array) -> Array:
        """The pressures that fields have, p in the film's p_unit."""
        given = np.array([one.p for one in self.supplies])
        own = [film.reduce.max(np.where(film.held.owner.ravel() == k, p, -np.inf)) for k in range(given.size)]
        return np.where(self.free, np.array(own) * film.p_unit, given)

    def put(self, film: Any, z: Array, P: Array) -> Array:
        """z with these pressures at the supplies' points."""
        return np.where(film.held.mask.ravel(), np.append(P / film.p_unit, 0.0)[film.held.owner.ravel()], z)

    def off(self, film: Any, p: Array, r: Array, P: Array, storage: Array) -> Array:
        """By how much of `storage` the supplies' points would have to store less for their balances to hold."""
        flows, out, owner = np.array(supply_flows(film, p, r)), np.zeros(p.size), film.held.owner.ravel()
        for k in np.flatnonzero(self.free):
            one, mine = self.supplies[k], owner == k
            room = volume_unit(film) * film.reduce.sum(np.where(mine, storage, 0.0))
            out[mine] = (flows[k] - one.given(P[k])) / room
        return out

    def step(self, film: Any, cavity: Any, z: Array, G: Array, P: Array) -> tuple[Array, Array] | None:
        """Changes of z and P; None where the film takes more than a source gives, or no pressure is found."""
        linear, feed = Linear(film, cavity), Feed(film, cavity, self.free)
        try:
            d, *answers = linear.solve([G, *(feed.pushed(t) for t in feed.free)])
            flows = np.array(supply_flows(film, np.maximum(z, 0.0), np.maximum(-z, 0.0))) - feed.taken(d)
            some = [one for one in self.supplies if one.open]
            new = balanced(some, P[self.free], self.like * flows[self.free], self.like * feed.slopes(answers), self.law)
        finally:
            linear.destroy()
            feed.destroy()
        if new is None:
            return None
        dP = np.zeros(P.size)
        dP[self.free] = new - P[self.free]
        return sum((by * answer for by, answer in zip(dP[self.free], answers, strict=True)), -d), dP
