"""`lcp-lube new`: a file with every key explained, which says the same as the scene that it is made from."""

import os
import tomllib

import numpy as np
import pytest

from lcp_lube import InputError, load_scene
from lcp_lube.scenes.scene import scene_names
from lcp_lube.scenes.template import run, template


def without_name(scene):
    return {key: value for key, value in scene.model_dump().items() if key != "name"}


@pytest.mark.parametrize("name", scene_names())
def test_the_same_scene(tmp_path, name, capsys):
    file = tmp_path / "mine.toml"
    assert run(file, name) == 0 and "made from" in capsys.readouterr().out
    mine, theirs = load_scene(file), load_scene(name)
    assert type(mine) is type(theirs) and without_name(mine) == without_name(theirs)
    assert os.listdir(tmp_path) == ["mine.toml"]
    assert max(map(len, file.read_text().splitlines())) < 140


@pytest.mark.parametrize("name", ["problem2", "journal", "pocketed_pad", "textured_slider", "rough"])
def test_the_same_equations(tmp_path, name):
    small = {"nx": 12, "ny": 9} if len(load_scene(name).shape) == 2 else {"n": 12}
    run(tmp_path / "mine.toml", name)
    mine, theirs = (load_scene(source, small).build() for source in (tmp_path / "mine.toml", name))
    for key in ("k_W", "k_E", "k_S", "k_N", "b_C", "b_W", "c", "h"):
        np.testing.assert_array_equal(getattr(mine.scheme, key), getattr(theirs.scheme, key))
    assert (mine.p_unit, mine.p_c, mine.mu, mine.U) == (theirs.p_unit, theirs.p_c, theirs.mu, theirs.U)
    for problem in (mine, theirs):
        problem.destroy()


def is_toml(line):
    try:
        return bool(tomllib.loads(line))
    except tomllib.TOMLDecodeError:
        return False


@pytest.mark.parametrize("name", scene_names())
def test_every_default_may_be_uncommented(tmp_path, name):
    """'# key = value' lines are what the scene has without them."""
    lines, table = [], True
    for line in template(name).splitlines():
        table = not line.startswith("# [") if line.startswith(("[", "# [")) else table
        lines.append(line.removeprefix("# ") if table and is_toml(line.removeprefix("# ")) else line)
    file = tmp_path / "all.toml"
    file.write_text("\n".join(lines))
    mine, theirs = without_name(load_scene(file)), without_name(load_scene(name))
    assert mine | {"n": 0} == theirs | {"n": 0}


def test_every_key_is_there():
    text = template("pocketed_pad")
    for key in (
        "L_mm",
        "width",
        "U",
        "p_in",
        "h_floor",
        "mu",
        "p_c",
        "p_supply",
        "depth_um",
        "between",
        "west",
        "n",
        "nx",
        "ny",
    ):
        assert f"\n{key} =" in text or f"\n# {key} =" in text, key
    assert "viscosity, Pa s; allowed: > 0" in text and "dimples" in text and 'default "face"' in text
    assert "width_over_diameter" in template("journal") and "\n# L =" not in template("journal")


def test_of_a_users_own_file(tmp_path):
    """A profile's path is told from the new file's folder."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "h.csv").write_text("0,3\n10,1\n")
    (tmp_path / "data" / "old.toml").write_text(
        'family = "bearing"\nL_mm = 10\nU = 1\nn = 5\n[fluid]\nmu = 0.01\n[film]\nshape = "profile"\nfile = "h.csv"\n'
        "[sides.west]\np = 1e5\n[balance]\nload = 100.0\n"
    )
    run(tmp_path / "new.toml", str(tmp_path / "data" / "old.toml"))
    old, new = load_scene(tmp_path / "data" / "old.toml"), load_scene(tmp_path / "new.toml")
    assert new.sides == old.sides and new.balance == old.balance and new.film[0].file == "data/h.csv"
    np.testing.assert_array_equal(new.gap(np.linspace(0, 0.01, 7)), old.gap(np.linspace(0, 0.01, 7)))


def test_refused(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("mine")
    with pytest.raises(InputError, match="the file is there already; it is not overwritten"):
        run(file, "journal")
    assert file.read_text() == "mine" and os.listdir(tmp_path) == ["mine.toml"]
    with pytest.raises(InputError, match=r"a name that ends in \.toml is needed"):
        run(tmp_path / "mine", "journal")
    with pytest.raises(InputError, match="nearest is journal"):
        run(tmp_path / "other.toml", "jornal")
    with pytest.raises(InputError, match="could not be written: No such file or directory"):
        run(tmp_path / "nowhere" / "other.toml", "journal")
    assert os.listdir(tmp_path) == ["mine.toml"]


def test_the_command(cli):
    made = cli("new", "mine.toml", "--from", "pocketed_pad", ranks=2)
    assert made.status == 0 and made.out.count("made from pocketed_pad") == 1
    mine, theirs = cli("solve", "mine.toml", "--json"), cli("solve", "pocketed_pad", "--json")
    assert mine.status == 0
    for key in ("load", "p_max", "iterations", "rupture", "reformation"):
        assert mine.json[key] == theirs.json[key]
    again = cli("new", "mine.toml", "--from", "pocketed_pad")
    assert again.status == 2 and again.lines == ["lcp-lube: new mine.toml: the file is there already; it is not overwritten"]
