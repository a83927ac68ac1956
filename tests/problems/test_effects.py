"""Effects with known answers: shear thinning, viscosity by place, a wall that gives way, roughness; together and on ranks."""

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, solve

MU, U, H, L = 0.05, 10.0, 2e-5, 0.1
PLATES = {"family": "bearing", "L": L, "U": U, "n": 60, "fluid": {"mu": MU}, "film": [{"shape": "constant", "h": H}]}
WEDGE = {**PLATES, "U": 4.0, "film": [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}]}
STRESS = MU * U / H


def test_eyring_between_plates():
    """The stress is tau_0 asinh(mu U/(h tau_0))."""
    tau_0 = 0.3 * STRESS
    with solve({**PLATES, "shear": {"law": "eyring", "tau_0": tau_0}}) as s:
        assert s.converged and s.friction == pytest.approx(tau_0 * np.arcsinh(STRESS / tau_0) * L, rel=1e-8)


def test_carreau_between_plates():
    time, n, least = 1e-5, 0.5, 0.2
    factor = least + (1 - least) * (1 + (time * U / H) ** 2) ** (0.5 * (n - 1))
    with solve({**PLATES, "shear": {"law": "carreau", "time": time, "n": n, "least": least}}) as s:
        assert s.friction == pytest.approx(STRESS * factor * L, rel=1e-8)


def test_viscosity_by_place(tmp_path):
    """p is proportional to a viscosity that is the same everywhere; a file says the same as a formula."""
    with solve(WEDGE) as plain, solve({**WEDGE, "viscosity": {"factor": "2"}}) as twice:
        assert twice.load == pytest.approx(2 * plain.load, rel=1e-3)  # which knows its exact line between the points
    np.save(tmp_path / "factor.npy", np.linspace(1.0, 3.0, 301))
    (tmp_path / "scene.toml").write_text(
        'family = "bearing"\nL = 0.1\nU = 4\nn = 60\nfluid.mu = 0.05\nviscosity.file = "factor.npy"\n'
        'film = [{ shape = "linear", h_start = 4e-5, h_end = 2e-5 }]\n'
    )
    with solve(tmp_path / "scene.toml") as a, solve({**WEDGE, "viscosity": {"factor": "1 + 20*x"}}) as b:
        assert a.load == pytest.approx(b.load, rel=1e-6)
        # Backwards the same film has its mirror image's viscosity.
        turned = {"U": -4.0, "film": [{"shape": "linear", "h_start": 2e-5, "h_end": 4e-5}], "viscosity": {"factor": "3 - 20*x"}}
        with solve({**WEDGE, **turned}) as c:
            assert c.load == pytest.approx(b.load, rel=1e-9)


@pytest.mark.parametrize("plane", [{}, {"dimension": 2, "width": 0.06, "nx": 31, "ny": 14}])
def test_a_wall_that_gives_way(plane):
    """h = h_rigid + C p at the answer, and what is thinnest, dragged and lost is that of this film."""
    C = 2e-12
    with solve({**WEDGE, **plane}) as rigid, solve({**WEDGE, **plane, "elastic": {"compliance": C}}) as s:
        assert s.converged and s.load < rigid.load
        np.testing.assert_allclose(s.h - rigid.h, C * s.p, rtol=1e-6, atol=1e-15)
        assert s.deflection_max == pytest.approx(C * s.p.max(), rel=1e-8) and s.min_h > rigid.min_h


def test_a_thin_liner():
    table = {"thickness": 1e-3, "E": 1e9, "nu": 0.4}
    C = 1e-3 * 1.4 * 0.2 / (1e9 * 0.6)
    with solve({**WEDGE, "elastic": table}) as a, solve({**WEDGE, "elastic": {"compliance": C}}) as b:
        assert a.load == pytest.approx(b.load, rel=1e-9)


def test_rough_plates():
    """Pressure drives phi_p of the smooth flow; a rough moving wall carries more oil, a rough one at rest less."""
    at_rest = {**PLATES, "U": 0.0, "p_in": 1e6}
    sigma = H / 3.0
    with solve(at_rest) as smooth, solve({**at_rest, "roughness": {"sigma": sigma}}) as rough:
        assert rough.flow["east"] == pytest.approx((1 - 0.9 * np.exp(-0.56 * 3)) * smooth.flow["east"], rel=1e-9)
    phi_s = 1.899 * 3**0.98 * np.exp(-0.92 * 3 + 0.05 * 9)
    for moving, sign in ((1.0, 1.0), (0.0, -1.0)):
        with solve({**PLATES, "roughness": {"sigma": sigma, "moving": moving}}) as s:
            assert s.flow["east"] == pytest.approx(0.5 * U * (H + sign * sigma * phi_s), rel=1e-9)


def test_all_together_and_on_ranks(cli):
    """Every effect at once, and the same answer on one, two and three ranks."""
    words = [
        "solve",
        "lined_pad",
        "--n",
        60,
        "--model",
        "full",
        "--json",
        "--set",
        "roughness.sigma=1e-6",
        "--set",
        "viscosity.factor=1+x",
    ]
    alone, two, three = (cli(*words, ranks=n) for n in (1, 2, 3))
    assert alone.status == two.status == three.status == 0, two.err + three.err
    for key in ("load", "friction", "temperature_max", "heat_out", "deflection_max"):
        assert two.json[key] == pytest.approx(alone.json[key], rel=1e-7)
        assert three.json[key] == pytest.approx(alone.json[key], rel=1e-7)
    assert all(alone.json[key] < 1e-8 for key in ("coupling", "energy_residual", "heat_defect"))


def test_no_convergence_is_an_outcome():
    """A wall that gives way by many times the film: the last state, and why."""
    with solve({**WEDGE, "elastic": {"thickness": 2e-2, "E": 1e6}}) as s:
        assert not s.converged and s.outcome in ("max_iterations", "not_finite", "linear_solver", "wrong_solution")
        assert "lift" in s.message or "film" in s.message
        assert s.p.size == 60


@pytest.mark.parametrize("softness", [10.0, 300.0])
def test_very_soft_walls_settle(softness):
    """Many times as thick as the rigid film is what the wall makes of it: its logarithm is nearly linear in the pressure's."""
    film = [{"shape": "sinusoid", "h_min": 1e-5, "h_max": 4e-5}]
    fluid = {"mu": 0.1, "p_supply": 1e5}
    data = {"family": "bearing", "dimension": 2, "L": 0.03, "width": 0.03, "U": 0.5, "nx": 47, "ny": 23}
    data |= {"fluid": fluid, "film": film}
    with solve({**data, "elastic": {"compliance": softness * 1e-10}}) as s:
        assert s.converged and s.fluid_solves <= 40
        assert s.deflection_max > 0.5 * softness * 1e-5
        assert s.certificate.measures["coupling"] <= 1e-9


def test_a_neighbours_fields_are_the_start():
    first = solve(load_scene("lined_pad", {"n": 99}), model="full")
    with solve(load_scene("lined_pad", {"n": 99, "U": 4.05}), start=first, model="full") as warm:
        assert warm.converged and warm.fluid_solves < first.fluid_solves
    first.destroy()


@pytest.mark.parametrize(
    "table, message",
    [
        ({"elastic": {}}, "compliance, or thickness and E, are needed"),
        ({"elastic": {"E": 2e9}}, "compliance, or thickness and E, are needed"),
        ({"elastic": {"thickness": 1e-3, "E": 210.0}}, "E = 210: at least 10 kPa is needed .SI units"),
        ({"elastic": {"thickness": 1e-3, "E": 1e9, "nu": 0.5}}, "elastic.nu = 0.5: allowed is less than 0.5"),
        ({"shear": {"law": "eyring"}}, "law = eyring: tau_0 is missing"),
        ({"shear": {"law": "eyrin", "tau_0": 1e6}}, "shear.law = eyrin: allowed is 'eyring' or 'carreau'"),
        ({"shear": {"law": "carreau", "time": 1e-6, "n": 1.5}}, "shear.n = 1.5: allowed is less than or equal to 1"),
        ({"roughness": {"sigma": -1e-6}}, "roughness.sigma = -1e-06: allowed is greater than 0"),
        ({"viscosity": {"factor": "z"}}, "z"),
        ({"viscosity": {"factor": "x - 0.05"}}, "its factor is -0.0.* somewhere: finite and above 0 is needed"),
        ({"temprature": {"oil": "ISO VG 32"}}, "unknown key temprature.*temperature"),
        ({"elastic": {"compliance": 1e-12}, "scheme": "upwind"}, "scheme = upwind: an effect on lift needs scheme = face"),
    ],
)
def test_refused(table, message):
    with pytest.raises(InputError, match=message):
        solve({**WEDGE, **table})
