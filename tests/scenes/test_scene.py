"""Scenes: what is read, what is refused, and in which words."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene
from lcp_lube.registry import FAMILIES, SCENE_DIR, scene_names
from lcp_lube.scenes.published import SliderScene
from lcp_lube.scenes.scene import as_scene, parse_changes, scene_line


@pytest.mark.parametrize("name", scene_names())
def test_built_in_scenes(name):
    scene = load_scene(name)
    assert scene.name == name and scene.family in FAMILIES
    assert all(n >= 1 for n in scene.shape)
    assert len(scene_line(name)) > 20 and scene_line(name)[0] != "#"
    assert load_scene(SCENE_DIR / f"{name}.toml") == scene


def test_published_data():
    scene = load_scene("problem2")
    assert (scene.h_min, scene.h_max, scene.L, scene.mu, scene.U) == (15e-6, 25e-6, 0.1, 0.015, 5.0)
    assert (scene.p_a, scene.p_b, scene.p_unit, scene.scheme, scene.shape) == (1e6, 1e6, 1e6, "nodal", (100,))
    assert load_scene("problem4").shape == (100, 100) and load_scene("problem4").wave == (0.375, 0.625)


def test_changes_come_last():
    scene = load_scene("problem1", {"h_min": 1e-5, "n": 7})
    assert scene.h_min == 1e-5 and scene.shape == (7,)
    assert load_scene("problem4", {"nx": 5}).shape == (5, 100)


def test_n_replaces_the_files_nx_and_ny(tmp_path):
    file = tmp_path / "flat.toml"
    file.write_text("family = 'slider'\ndimension = 2\nnx = 40\nny = 3\n")
    assert load_scene(file).shape == (40, 3)
    assert load_scene(file, {"n": 9}).shape == (9, 9)
    assert load_scene(file, {"n": 9, "ny": 2}).shape == (9, 2)


def test_with_shape_changes_the_grid_alone():
    scene = load_scene("problem4", {"U": 3.0})
    assert scene.with_shape((5, 7)).shape == (5, 7) and scene.with_shape((5, 7)).U == 3.0
    assert load_scene("problem1").with_shape((5,)).shape == (5,)


def test_only_a_1d_scene_has_an_exact_solution():
    assert load_scene("problem1").exact().rupture == pytest.approx(0.065974581544, abs=1e-12)
    assert load_scene("problem4").exact() is None


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"h_min": -1e-6}, "h_min = -1e-06: allowed is greater than 0"),
        ({"h_min": 0.0}, "h_min = 0.0: allowed is greater than 0"),
        ({"mu": 0}, "mu = 0: allowed is greater than 0"),
        ({"mu": float("nan")}, "mu = nan: allowed is a finite number"),
        ({"U": float("inf")}, "U = inf: allowed is a finite number"),
        ({"p_a": -1.0}, "p_a = -1.0: allowed is greater than or equal to 0"),
        ({"p_c": float("nan")}, "p_c = nan: allowed is a finite number"),
        ({"n": 0}, "n = 0: allowed is greater than or equal to 1"),
        ({"n": -3}, "n = -3: allowed is greater than or equal to 1"),
        ({"n": 10**12}, "n = 1000000000000: allowed is less than or equal to 2147483646"),
        ({"n": 10.5}, "n = 10.5: allowed is a valid integer"),
        ({"n": "many"}, "n = many: allowed is a valid integer"),
        ({"h_min": True}, "h_min = True: allowed is a valid number"),
        ({"h_min": "15e-6 mum"}, "h_min = 15e-6 mum: 'mum' is no unit; nearest is um"),
        ({"h_min": "1 MPa"}, "h_min = 1 MPa: a length (m, mm, um, nm) is needed, not a pressure"),
        ({"p_a": "15um"}, "p_a = 15um: a pressure (Pa, kPa, MPa, GPa, bar) is needed, not a length"),
        ({"U": "3000 rpm"}, "U = 3000 rpm: a speed (m/s, mm/s, km/h) is needed, not an angular velocity"),
        ({"mu": "1%"}, "mu = 1%: a viscosity (Pa s, mPa s, cP) is needed"),
        ({"h_min_um": "15um"}, "h_min_um = 15um: a number without a unit is needed, not a length"),
        ({"n": "1 m"}, "n = 1 m: a number without a unit is needed, not a length"),
        ({"p_a": "1e99999 MPa"}, "p_a = inf: allowed is a finite number"),
        ({"h_min": [1e-5]}, "h_min = [1e-05]: allowed is a valid number"),
        ({"h_min": 3e-5}, "h_max = 2.5e-05: at least h_min = 3e-05 is needed"),
        ({"film": "saw"}, "film = saw: allowed is 'sinusoid' or 'parabola'"),
        ({"scheme": "nodl"}, "scheme = nodl: allowed is 'nodal', 'face' or 'upwind'"),
        ({"dimension": 3}, "dimension = 3: allowed is 1 or 2"),
        ({"wave": [0.5, 0.5]}, "wave = [0.5, 0.5]: 0 <= start < end <= 1 is needed"),
        ({"wave": [0.5, 1.5]}, "wave = [0.5, 1.5]: 0 <= start < end <= 1 is needed"),
        ({"wave": [0.5]}, "wave.1"),
        ({"u": 3.0}, "unknown key u; nearest is U"),
        ({"H_MIN": 3.0}, "unknown key H_MIN; nearest is h_min"),
        ({"hmin": 1e-5}, "unknown key hmin; nearest is h_min"),
        ({"viscosity": 1.0}, "viscosity = 1.0: a table is needed (the viscosity itself is mu)"),
        ({"viscosities": 1.0}, "unknown key viscosities; nearest is viscosity"),
        ({"ny": 5}, "ny = 5: the scene is one-dimensional"),
        ({"width": 1.0}, "width = 1.0: the scene is one-dimensional"),
        ({"p_side": 1e5}, "p_side = 100000.0: the scene is one-dimensional"),
        ({"family": "slidr"}, "family = slidr: allowed are slider, "),
        ({"family": ["slider"]}, "family = ['slider']: allowed are slider, "),
        ({"name": 5}, "name = 5: allowed is a valid string"),
    ],
)
def test_refused_values(changes, message):
    with pytest.raises(InputError) as caught:
        load_scene("problem1", changes)
    assert str(caught.value).startswith(f"problem1: {message}") and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["journal", "two_groove_journal", "dam_journal", "tilting_pad_thrust", "tilting_pad_journal"])
def test_true_is_no_number(name):
    for key, field in type(load_scene(name)).model_fields.items():
        if "float" in str(field.annotation) and "dict" not in str(field.annotation):
            with pytest.raises(InputError):
                load_scene(name, {key: True})


@pytest.mark.parametrize(
    "content, message",
    [
        (b"", "the file sets nothing"),
        (b"# only a remark\n", "the file sets nothing"),
        (b"h_min = \n", "Invalid value (at line 1, column 9)"),
        (b"h_min 1e-5\n", "Expected '=' after a key"),
        (b"h_min = 1e-5\nh_min = 2e-5\n", "Cannot overwrite a value"),
        (b"\xff\xfe\x00n", "'utf-8' codec can't decode byte 0xff"),
        (b"\x00\x01\x02", "Invalid"),
        (b"family = 'slider'\n[slider]\nn = 5\n", "unknown key slider"),
        (b"family = 'slider'\nn = 1979-05-27\n", "n = 1979-05-27: allowed is a valid integer"),
        (b"n = 5\n", "family is missing; allowed are slider, "),
        (b"family = 'slider'\nh_min = 'thin'\n", "h_min = thin: allowed is a valid number"),
    ],
)
def test_refused_files(tmp_path, content, message):
    file = tmp_path / "odd.toml"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_scene(file)
    assert str(caught.value).startswith(f"{file}: {message}") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "source, message",
    [
        ("problem5", "scene problem5: neither a .toml file nor a built-in name; nearest is problem"),
        ("/tmp", "scene /tmp: neither a .toml file nor a built-in name"),
        ("", "scene : neither a .toml file nor a built-in name"),
        ("no_such_file.toml", "no_such_file.toml: No such file or directory"),
    ],
)
def test_no_such_scene(source, message):
    with pytest.raises(InputError) as caught:
        load_scene(source)
    assert str(caught.value).startswith(message)


def test_a_folder_is_no_scene(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(InputError, match=r"folder\.toml: Is a directory$"):
        load_scene(tmp_path / "folder.toml")


def test_parse_changes():
    given = ["h_min=1e-5", " n = 7", "film=parabola", "wave=[0.1, 0.9]", "mean_cubes=true", "U=1", "U=2", 'name="a=b"']
    assert parse_changes([*given, "balance=none"]) == {
        "h_min": 1e-5,
        "n": 7,
        "film": "parabola",
        "wave": [0.1, 0.9],
        "mean_cubes": True,
        "U": 2,
        "name": "a=b",
        "balance": None,
    }


@pytest.mark.parametrize("text", ["h_min", "=1", "h_min=", "", " = "])
def test_changes_without_key_or_value(text):
    with pytest.raises(InputError, match=r"^--set .*: KEY=VALUE is needed$"):
        parse_changes([text])


@given(
    st.dictionaries(
        st.sampled_from([*SliderScene.model_fields, "nope"]),
        st.one_of(
            st.none(),
            st.booleans(),
            st.integers(),
            st.floats(),
            st.text(max_size=5),
            st.lists(st.floats(), max_size=3),
            st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
        ),
        max_size=3,
    )
)
def test_any_values_make_a_scene_or_one_line(changes):
    """Never another exception, whatever a file holds."""
    try:
        scene = load_scene("problem1", changes)
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert scene.h_min > 0 and scene.shape[0] >= 1


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_changed_is_the_scene_loaded_with_the_change(name):
    scene, changes = load_scene(name), {"n": 90}
    assert as_scene(scene, changes) == as_scene(name, changes) == load_scene(name, **changes)
    assert as_scene(scene, {}) is scene


def test_scenes_from_dictionaries_and_with_keywords(tmp_path):
    file = tmp_path / "pad.toml"
    file.write_text('family = "bearing"\nL_mm = 20\nU = 1\nfluid.mu = 0.02\n[[film]]\nshape = "constant"\nh_um = 20\n')
    data = {"family": "bearing", "L_mm": 20, "U": 1, "fluid": {"mu": 0.02}, "film": [{"shape": "constant", "h_um": 20}]}
    for scene in (load_scene(file), load_scene(data), load_scene({**data, "U": 3}, U=np.int64(1))):
        assert (scene.L, scene.U, scene.fluid.mu, scene.film[0].h) == (0.02, 1, 0.02, 20e-6)
    assert load_scene(data, {"film.h_um": 5, "U": 2}, U=4.0).U == 4.0
    assert load_scene("journal", eccentricity=0.7) == load_scene("journal", {"eccentricity": 0.7})
    assert as_scene(load_scene("journal"), {"D": 0.2}).L == load_scene("journal", D=0.2).L  # L follows anew
    assert data == {**data, "film": [{"shape": "constant", "h_um": 20}]}


@pytest.mark.parametrize(
    "source, changes, message",
    [
        ("problem4", {"metod": "din"}, "problem4: metod is neither a key of the scene nor an argument; nearest is method"),
        ({"family": "bearing", "U": 1}, {}, "scene: L is missing"),
        ({"family": "bering"}, {}, "scene: family = bering: allowed are "),
        ({"family": "slider"}, {"h_mim": 1e-6}, "scene: unknown key h_mim; nearest is h_min"),
    ],
)
def test_faults_of_a_dictionary(source, changes, message):
    with pytest.raises(InputError) as error:
        as_scene(source, changes, also=("method", "system"))
    assert str(error.value).startswith(message)


def test_a_scene_says_what_was_given_and_is_pickled():
    scene = load_scene("journal", eccentricity=0.7)
    assert repr(scene) == "JournalScene(name='journal', nx=360, ny=79, eccentricity=0.7)"
    assert pickle.loads(pickle.dumps(scene)) == scene == copy.deepcopy(scene)
