"""Never wrong and silent: with its insides corrupted, a run ends as not converged and says why, or its answer is right."""

import numpy as np
import pytest
from petsc4py import PETSc

from lcp_lube import Complementarity
from lcp_lube.api import solve
from lcp_lube.base.stages import Stages
from lcp_lube.problems.solution import Outcome, Step
from lcp_lube.registry import MethodEntry
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.enclosure import enclose

SCENES = {
    "problem1": ({"n": 25}, ("auto", "din", "din-pc", "fbn-a", "fbn-i", "active-set", "monotone")),
    "problem3": ({"n": 25}, ("auto", "din", "din-pc", "fbn-a", "fbn-i", "active-set", "monotone")),
    "problem4": ({"nx": 9, "ny": 6}, ("auto", "din", "fbn-a", "monotone")),
    "obstacle_bratu": ({"n": 9}, ("active-set", "interior", "semismooth")),
    "bratu": ({"n": 9}, ("newton",)),
    "poisson_cubic": ({"n": 9}, ("newton",)),
    "manufactured_cubic": ({"n": 9}, ("newton",)),
    "ehl_line": ({"n": 30}, ("interior", "semismooth")),
    "user": ({}, ("active-set", "interior", "semismooth")),
}
RUNS = [(name, method) for name, (_, methods) in SCENES.items() for method in methods]
FEW = {"max_it": 12}

# What is put in, and whether a method might still get to the right answer with it: inexact Newton steps are legitimate.
KSPS: dict[str, tuple[dict[str, object], bool]] = {
    "x = 0": ({"ksp_type": "python", "ksp_python_type": "corrupted.Lazy"}, False),
    "noise": ({"ksp_type": "python", "ksp_python_type": "corrupted.Noise"}, False),
    "x = b": ({"ksp_type": "python", "ksp_python_type": "corrupted.Copy"}, True),
    "one NaN": ({"ksp_type": "python", "ksp_python_type": "corrupted.Holey"}, False),
    "wrong sign": ({"ksp_type": "python", "ksp_python_type": "corrupted.Backwards"}, True),
    "30 % off": ({"ksp_type": "python", "ksp_python_type": "corrupted.Sloppy"}, True),
    "NaN by the PC": ({"ksp_type": "gmres", "pc_type": "python", "pc_python_type": "corrupted.NaNPC"}, False),
    "NaN by the PC, unchecked": ({"ksp_type": "preonly", "pc_type": "python", "pc_python_type": "corrupted.NaNPC"}, False),
    "0 by the PC": ({"ksp_type": "preonly", "pc_type": "python", "pc_python_type": "corrupted.ZeroPC"}, False),
    "0 by the PC in GMRES": ({"ksp_type": "gmres", "pc_type": "python", "pc_python_type": "corrupted.ZeroPC"}, False),
    "inner tolerance 1": ({"ksp_type": "gmres", "pc_type": "none", "ksp_rtol": 1.0}, False),
    "no inner iteration": ({"ksp_type": "gmres", "pc_type": "none", "ksp_max_it": 0}, False),
}
if PETSC_REFUSES_RTOL_1 := PETSc.Sys.getVersion() > (3, 19):
    del KSPS["inner tolerance 1"]


M, Q = np.array([[4.0, -1.0, 0.0], [-1.0, 4.0, 0.0], [0.0, -1.0, 4.0]]), np.array([-1.0, 2.0, -3.0])


def users(J=M):
    """A linear complementarity problem of a user's."""
    return Complementarity(lambda x: M @ x + Q, lambda x: J, [0.0] * 3, [np.inf] * 3, [1.0, 2.0, 1.0])


def scene_of(name):
    return users() if name == "user" else load_scene(name, SCENES[name][0])


@pytest.fixture(scope="module")
def right():
    """`right(name)`: the fields of the scene's solution, solved for once with nothing corrupted."""
    known = {}

    def find(name):
        if name not in known:
            solution = solve(scene_of(name), nested=False)
            assert solution.converged
            known[name] = {key: a.copy() for key, a in solution.fields.items()}
            solution.destroy()
        return known[name]

    return find


def assert_honest(solution, right, may_converge):
    """Not converged, with an outcome and a message; or, where that can be, converged to the right answer."""
    if solution.converged:
        # Principal pivoting has elimination of its own, and may take over from a method whose inner solver lies.
        assert may_converge or solution.settings["method"] == "pivoting", f"converged: {solution.message}"
        for name, expected in right.items():
            np.testing.assert_allclose(solution.fields[name], expected, atol=1e-3 * np.abs(expected).max())
    else:
        assert solution.outcome is not Outcome.NO_SOLUTION  # that would be a false statement on these problems
        assert len(solution.message) > 10


@pytest.mark.parametrize("corruption", KSPS)
@pytest.mark.parametrize("name, method", RUNS)
def test_inner_solvers_that_lie(name, method, corruption, right, petsc_options):
    options, may_converge = KSPS[corruption]
    expected = right(name)
    petsc_options(**options)
    solution = solve(scene_of(name), method=method, nested=False, stopping=FEW)
    assert_honest(solution, expected, may_converge)
    solution.destroy()


@pytest.mark.parametrize("corruption", KSPS)
def test_inner_solvers_that_lie_to_the_cavity_system(corruption, petsc_options):
    """Elimination and scaling stand between the KSP and the method there."""
    options, may_converge = KSPS[corruption]
    scene = load_scene("problem4", {"n": 24})
    good = solve(scene, method="active-set", system="reduced", nested=False)
    petsc_options(**options)
    bad = solve(scene, method="active-set", system="cavity", nested=False, stopping=FEW, options={"sweeps": 0})
    assert_honest(bad, good.fields, may_converge)
    for solution in (good, bad):
        solution.destroy()


class Claiming:
    """A method that has converged at once, as it says, with `damage` done to fields that were right."""

    certificate = None  # nobody has made one of these fields

    def __init__(self, method, right, damage):
        self._method, self._right, self._damage = method, right, damage
        self.norm, self.krylov, self.destroy = method.norm, method.krylov, method.destroy

    def advance(self):
        return Step(0.0, 0.0, 1.0)

    @property
    def fields(self):
        if self._damage == "none at all":
            return self._method.fields
        fields = {name: a.copy() for name, a in self._right.items()}
        values = fields[next(iter(fields))]
        DAMAGES[self._damage](values)
        return fields


def _put(where, value):
    def put(values):
        values[where(values)] = value

    return put


DAMAGES = {
    "none at all": None,  # the start instead of the answer
    "NaN": _put(lambda a: a.size // 2, np.nan),
    "NaN everywhere": _put(lambda a: slice(None), np.nan),
    "infinity": _put(lambda a: a.size // 2, np.inf),
    "zero": _put(lambda a: slice(None), 0.0),
    "shifted": lambda a: np.add(a, 0.1 * np.abs(a).max(), out=a),
    "negative": lambda a: np.negative(a, out=a),
    "scaled": lambda a: np.multiply(a, 1.5, out=a),
    "one point": _put(lambda a: np.argmax(a), 0.0),
    "turned round": lambda a: np.copyto(a, np.roll(a, a.size // 3)),
}


@pytest.mark.parametrize("name, method", [(name, methods[-1]) for name, (_, methods) in SCENES.items()] + [("problem4", "fas")])
@pytest.mark.parametrize("damage", DAMAGES)
def test_methods_that_claim_to_have_converged(name, method, damage, right, monkeypatch):
    """The certificate alone stands between such a claim and the user: it never holds, and NaN is no exception."""
    expected, load = right(name), MethodEntry.load

    def corrupted(self):
        build = load(self)
        return lambda *words: Claiming(build(*words), expected, damage)

    monkeypatch.setattr(MethodEntry, "load", corrupted)
    solution = solve(scene_of(name), method=method, nested=False, certify=name.startswith("problem"))
    assert not solution.converged and solution.outcome is Outcome.WRONG_SOLUTION
    assert "the certificate fails" in solution.message
    assert solution.enclosure is None or not solution.enclosure.certified
    solution.destroy()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", SCENES)
def test_certificates_of_numbers_that_are_none(name, value, right):
    """One of them anywhere breaks the certificate."""
    problem = scene_of(name).build()
    for key, a in right(name).items():
        for place in {0, a.size // 2, a.size - 1}:
            fields = {k: v.copy() for k, v in right(name).items()}
            fields[key][place] = value
            with np.errstate(all="ignore"):
                assert not problem.certify(fields, 1e-8).holds
    problem.destroy()


def test_a_system_of_the_wrong_sign(monkeypatch):
    """Newton matrices times -1 in every method on films: each ends as not converged."""
    from lcp_lube.linear.full import FullSystem
    from lcp_lube.linear.reduced import ReducedSystem

    for system in (FullSystem, ReducedSystem):
        original = system.resolve

        def reversed_(self, f1, f2, rtol, original=original):
            dp, dr, iterations = original(self, f1, f2, rtol)
            return -dp, -dr, iterations

        monkeypatch.setattr(system, "resolve", reversed_)
    for method in ("din", "din-pc", "fbn-a", "fbn-i", "active-set"):
        options = {} if method != "active-set" else {"patience": 3}
        solution = solve(scene_of("problem1"), method=method, stopping=FEW, options=options, rescue=False)
        assert not solution.converged, (method, solution.message)
        solution.destroy()


@pytest.mark.parametrize("corruption", KSPS)
def test_bands_by_a_solver_that_lies(corruption, right, petsc_options):
    """A band is a guess and a proof: without a good guess there is none, or one that holds all the same."""
    problem, fields = scene_of("problem3").build(), right("problem3")
    petsc_options(**KSPS[corruption][0])
    for factor in (1.0, 1.0 + 1e-9, 1.01):
        found = enclose(problem, {name: factor * a for name, a in fields.items()}, "reduced", Stages())
        if found.certified:
            assert np.abs((factor - 1.0) * fields["p"]).max() * problem.p_unit <= found.bounds["band_p"] * (1 + 1e-3)
        assert factor < 1.01 or not found.certified
    problem.destroy()


@pytest.mark.parametrize("J", [-M, np.zeros((3, 3)), np.full((3, 3), np.nan), M.T[::-1].copy(), 1e300 * M], ids=str)
@pytest.mark.parametrize("method", ["active-set", "interior", "semismooth"])
def test_a_users_wrong_jacobian(J, method, right):
    solution = solve(users(J), method=method, stopping=FEW)
    assert_honest(solution, right("user"), may_converge=True)
    solution.destroy()


def test_a_certificate_of_nan():
    """A certificate whose measures are NaN holds for nothing."""
    from lcp_lube.problems.certificate import Certificate

    assert not Certificate({"residual": float("nan")}, 1.0).holds
    assert not Certificate({"residual": 0.0, "mass_defect": float("inf")}, 1.0).holds


@pytest.mark.parametrize(
    "words",
    [
        "problem1 --no-rescue -ksp_type python -ksp_python_type tests.corrupted.Lazy",
        "problem3 --method din -ksp_type python -ksp_python_type tests.corrupted.Noise",
        "problem4 --n 9 --no-rescue -ksp_type gmres -pc_type python -pc_python_type tests.corrupted.NaNPC",
        pytest.param(
            "obstacle_bratu --n 9 --method interior -ksp_type gmres -pc_type none -ksp_rtol 1",
            marks=pytest.mark.skipif(PETSC_REFUSES_RTOL_1, reason="newer releases refuse this tolerance"),
        ),
    ],
)
def test_the_command_line(cli, words):
    """Exit status 1, no traceback, one JSON object that tells."""
    run = cli("solve", *words.split(), "--max-it", 12, "--json")
    assert run.status == 1 and "Traceback" not in run.err
    assert run.json["converged"] is False and run.json["outcome"] != "converged" and len(run.json["message"]) > 10
