"""[temperature]: viscosity that depends on the temperature, and the heat balance that the temperature follows from."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.parallel import Array
from ...problems.film import oils
from ...problems.film.effects import Answer, Cells, Effect, Report
from ...problems.film.exact import bisect
from ..scene import Finite, NotNegative, Positive
from ..units import measured
from .table import EffectTable

Kelvin = Annotated[Finite, Field(ge=oils.LOWEST, le=oils.HIGHEST)]
NEWTON, FOUND, NEAR = 30, 1e-9, 1e-2  # steps, and K: of T ahead; for derivatives by T
ALIKE = 0.03  # of log(viscosity): a change after which one more step would move T by less than a part in 1000
LITTLE = 1e-6  # of the heat of a full film, that walls could take, and that films hold for a step: less is rounding
POINTS = {"exponential": 2, "walther": 2, "roelands": 2, "vogel": 3}


class Temperature(EffectTable):
    """Heat: by a balance of the whole bearing, or by the energy equation averaged over the film.

    The viscosity by temperature: of an oil by its grade; by a law through points T, mu (then mu is not given elsewhere, and the
    film without this effect has that of T_in); or exp(-beta (T - T_in)) times the scene's mu.
    """

    model: Literal["energy", "effective"] = Field("energy", description="equation in the film, or one effective temperature")
    T_in: Kelvin = measured("K", 313.15, "temperature of the oil that is supplied")
    oil: str | None = Field(None, description="grade of a mineral oil (ISO 3448), ISO VG 32 say; viscosity index 100")
    law: Literal["exponential", "vogel", "walther", "roelands"] | None = Field(None, description="law through the points T, mu")
    T: list[Kelvin] | None = measured("K", None, "temperatures at which mu is given: 2, or 3 for vogel")
    mu: list[Positive] | None = measured("Pa s", None, "viscosities at T")
    beta: Annotated[Finite, Field(ge=0, le=1)] | None = measured("1/K", None, "viscosity: mu exp(-beta (T - T_in))")
    rho: Positive = measured("kg/m^3", oils.DENSITY, "density of the oil")
    specific_heat: Positive = measured("J/kg/K", oils.SPECIFIC_HEAT, "specific heat of the oil")
    exchange: NotNegative = measured("W/m^2/K", 0.0, "heat transfer to the walls (energy); 0: adiabatic")
    T_wall: Kelvin | None = measured("K", None, "temperature of the walls; default T_in")
    carry_over: Annotated[Finite, Field(ge=0, le=1)] | None = Field(
        None,
        description="share of the oil arriving at a groove or supply (or east, for the west side) that goes on; default all, "
        "nothing at sides",
    )
    share: Annotated[Finite, Field(gt=0, le=1)] = Field(
        0.5, description="effective: T_eff = T_in + share (T_out - T_in), 1/2 in ISO 7902"
    )

    def check(self) -> None:
        given = [name for name in ("oil", "law", "beta") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise ValueError(f"one of oil, law (with T and mu) and beta is needed for the viscosity, found {found}")
        if self.oil is not None:
            oils.named(self.oil)
        if (self.law is None) != (self.T is None) or (self.law is None) != (self.mu is None):
            raise ValueError("law, T and mu go together: all of them or none")
        if self.law is not None and self.T is not None and self.mu is not None:
            n = POINTS[self.law]
            if len(self.T) != n or len(self.mu) != n:
                raise ValueError(f"T and mu: {n} values each are needed for law = {self.law}")
            if sorted(set(self.T)) != self.T or sorted(set(self.mu), reverse=True) != self.mu:
                raise ValueError(f"T = {self.T}, mu = {self.mu}: T rising and mu falling is needed")
            self.viscosity(0.0)

    @property
    def own_mu(self) -> float | None:
        """The viscosity at T_in, where it follows from this table; Pa s."""
        return None if self.beta is not None else float(self.viscosity(0.0)(np.array(self.T_in)))

    def viscosity(self, mu: float) -> oils.Viscosity:
        """The law; mu : the scene's viscosity, at T_in, for those who go by beta."""
        if self.oil is not None:
            return oils.named(self.oil, self.rho)
        if self.beta is not None:
            return oils.Exponential(mu, self.T_in, self.beta)
        assert self.T is not None and self.mu is not None  # as `check` found
        if self.law == "walther":
            return oils.Walther.through(self.T, [1e6 * one / self.rho for one in self.mu], self.rho)
        laws: dict[str | None, Any] = {"vogel": oils.Vogel, "roelands": oils.Roelands}
        return laws.get(self.law, oils.Exponential).through(self.T, self.mu)

    def effect(self, scene: Any) -> "Heat":
        mu = scene.mu_0
        wall = (self.T_wall or self.T_in) - self.T_in
        return Heat(self.viscosity(mu), mu, self, wall)


@dataclass(frozen=True)
class Heat(Effect):
    """Viscosity from the temperatures of an answer. law : mu(T), Pa s. mu : where there is no effect. wall : T_wall - T_in."""

    law: oils.Viscosity
    mu: float
    table: Temperature
    wall: float
    channels: ClassVar[tuple[str, ...]] = ("viscosity", "warmth")

    @property
    def carried(self) -> tuple[str, float] | None:
        return "T", self.table.T_in

    def apply(self, at: Answer, out: Cells) -> None:
        if ("ahead", id(self)) not in at.memory:
            at.memory["ahead", id(self)] = self.law(self._ahead(at)) / self.mu
        factor = at.memory["ahead", id(self)]
        out["viscosity"] *= factor
        out["warmth"] *= factor

    def _ahead(self, at: Answer) -> Array:
        """T at the points where the wall drags by the viscosity of these temperatures, not of those before, K. Collective.

        What the wall drags goes with the viscosity: heat by the old one would throw T far beyond or far below the answer, and
        back. Where the viscosity stays what it is both are the same. By Newton's method, from the old T.
        """
        from ...problems.film.carried import carried  # here, and below: every film's scene has this table
        from ...problems.film.energy import fresh_flow, heated

        table, reduce, law = self.table, at.problem.reduce, self.law
        flow, rho_c, box = carried(at, told=False), table.rho * table.specific_heat, at.grid.box
        coldest = table.T_in + min(self.wall, 0.0)  # heat arises only: an iterate that is colder is no film's
        old = at.cells["warmth"] * self.mu
        if table.model == "effective":
            fresh, power = fresh_flow(at, flow, table.carry_over), float(reduce.sum(flow.dissipation))
            sheared, before = float(reduce.sum(flow.sheared)), reduce.max(old)
            held, kept = reduce.sum(flow.held), rho_c * reduce.sum(flow.kept)
            by_heat = lambda T: power + kept + sheared * (law(T) / before - 1.0)  # noqa: E731
            gain = self._gain(rho_c, fresh, held)
            with np.errstate(invalid="ignore"):
                T = bisect(lambda T: table.T_in + gain * by_heat(T) - T, np.array([coldest]), np.array([oils.HIGHEST]))
            return np.full(at.p.size, T[0])
        with np.errstate(all="ignore"):
            T = np.clip(np.nan_to_num(law.T(old), nan=oils.HIGHEST), coldest, oils.HIGHEST)
        before = FOUND
        for _ in range(1 if at.once else NEWTON):
            ratio, slope = law(T) / old, (law(T + NEAR) - law(T - NEAR)) / (2.0 * NEAR * old)
            falls = np.maximum(-slope, 0.0) * flow.sheared.ravel()
            more = flow.sheared.ravel() * (ratio - 1.0) + falls * (T - table.T_in)
            steps = (falls.reshape(box), more.reshape(box))
            new = table.T_in + heated(at, flow, rho_c, table.exchange, self.wall, table.carry_over, *steps).theta
            new = np.clip(np.nan_to_num(new, nan=oils.HIGHEST), coldest, oils.HIGHEST)
            T, moved = new, reduce.max(np.abs(new - T))
            if at.rough and reduce.max(np.abs(np.log(law(T) / old))) < ALIKE:
                break
            if not moved * (moved / before) ** 2 > FOUND:  # what the next step is expected to move
                break
            before = moved
        return T

    def _gain(self, rho_c: float, fresh: float, held: float) -> float:
        """By what a watt raises the effective temperature, K/W; held : liquid that stays in the film, over a step's length."""
        carries = rho_c * (max(fresh, 0.0) / self.table.share + held)
        return 1.0 / carries if carries > 0 else np.inf

    def _solve(self, at: Answer) -> tuple[Array, dict[str, float], float]:
        """T at the points, K; what is told of the heat; the equations' residual. Collective."""
        from ...problems.film.carried import carried
        from ...problems.film.energy import fresh_flow, heated

        table, reduce = self.table, at.problem.reduce
        flow, rho_c = carried(at), table.rho * table.specific_heat
        power = float(reduce.sum(flow.dissipation))
        fresh = fresh_flow(at, flow, table.carry_over)
        if table.model == "energy":
            found = heated(at, flow, rho_c, table.exchange, self.wall, table.carry_over)
            T, out, residual, stored = table.T_in + found.theta, found.out, found.residual, found.stored
            through = np.where(flow.free, flow.area * (found.theta - self.wall).reshape(flow.area.shape), 0.0)
            by_flow = out - table.exchange * reduce.sum(through)
            effective = reduce.sum(np.where(flow.free.ravel(), T, 0.0)) / max(reduce.sum(flow.free.astype(float)), 1.0)
        else:
            held, kept = reduce.sum(flow.held), rho_c * reduce.sum(flow.kept)
            heat = power + kept
            rise = heat * self._gain(rho_c, fresh, held) if heat else 0.0
            stored = rho_c * held * rise - kept if held else 0.0
            out = by_flow = power - stored
            effective, residual = table.T_in + rise, 0.0
            T = np.full(at.p.size, effective)
        if fresh > 0:
            T_out = table.T_in + by_flow / (rho_c * fresh)
        else:  # nothing flows out: in time what stays in the film is as warm as that is
            T_out = effective if at.problem.stored is not None else np.inf if power > 0 else table.T_in
        walls = table.exchange * float(reduce.sum(flow.area)) * max(reduce.max(T) - table.T_in, abs(self.wall))
        drag = at.base.U**2 * float(reduce.sum(flow.area.ravel() * at.mu / at.h))
        gross = walls + drag + rho_c * float(reduce.sum(np.abs(flow.kept)))
        size = max(abs(flow.power), abs(power), abs(out), abs(stored), LITTLE * gross)
        told = {
            "temperature_max": max(reduce.max(T), T_out if table.model == "effective" else -np.inf),
            "temperature_effective": float(effective),
            "temperature_out": float(T_out),
            "heat_power": flow.power,
            "heat_out": out,
            "heat_defect": abs(flow.power - out - stored) / size if size > 0 else 0.0,
        }
        told |= {"heat_stored": stored} if at.problem.stored is not None else {}
        return T, told, residual

    def report(self, at: Answer) -> Report:
        if id(self) not in at.memory:  # taken once an answer
            at.memory[id(self)] = self._solve(at)
        T, told, residual = at.memory[id(self)]
        measures = {"energy_residual": residual, "heat_defect": told["heat_defect"]}
        hottest, coldest = told["temperature_max"], at.problem.reduce.min(T)
        failure = ""
        if not (hottest <= oils.HIGHEST and coldest >= oils.LOWEST):
            has = f"have {coldest:.4g} to {hottest:.4g} K, {oils.LOWEST:g} to {oils.HIGHEST:g} K are allowed"
            stays = "get ever hotter, as some of it does not flow and no heat goes through the walls (temperature.exchange)"
            would = has if np.isfinite(hottest) else stays
            failure = f"no steady temperature: the oil would {would}; too little oil carries the heat away"
        mu = at.base.mu * at.cells["viscosity"] * at.law.viscosity(at.p)
        numbers = {key: value for key, value in told.items() if key != "heat_defect"}
        return Report(numbers, measures, {"T": (T, "K"), "mu": (mu, "Pa s")}, failure)
