"""The object database: the shipped objects are valid; invalid files are refused with file, line and field, and the old
entry stays."""

import os

import pytest
from coglab_objects.database import (
    ObjectDatabase,
    ObjectError,
    cell_parameters,
    new_object_text,
    objects_folder,
    parse_object,
)

MUG = (objects_folder() / "mug.yaml").read_text()
OBJECTS = ["ball", "bottle", "mug", "screwdriver", "tea_box"]


def test_five_sample_objects_without_a_problem():
    database = ObjectDatabase(objects_folder())
    assert database.reload() == []
    assert database.ids() == OBJECTS


@pytest.mark.parametrize(
    "change, sentence",
    [
        (("mass: 0.31", "mass: -1"), "mug.yaml:5: mass: -1"),
        (("mass: 0.31\n", ""), "'mass'"),
        (("friction: 0.6", "friction: 0.6\nfrction: 0.6"), "'frction'"),
        (("mode: cylindrical", "mode: claw"), "grasps.side.hand.mode: 'claw'"),
        (("default_grasp: side", "default_grasp: top"), "default_grasp: 'top'"),
        (("[0.5, 0.5, 0.5, 0.5]", "[0, 0, 0, 0]"), "quaternion"),
        (("xyz: [0.0, -0.04, 0.07]", "xyz: [0.0, -40.0, 0.07]"), "1 m"),
        (("axis: [0.0, 1.0, 0.0]", "axis: [0.0, 0.0, 0.0]"), "direction"),
        (("id: mug", "id: Mug Cup"), "id: 'Mug Cup'"),
        (("mass: 0.31", "mass: 0.31\nmass: 0.4"), "'mass' appears twice"),
        (("mass: 0.31", "mass: [0.31"), "not YAML"),
        (("mass: 0.31", "mass: &m 0.31\nnotes: *m"), "aliases"),
        (("mass: 0.31", "mass: .nan"), "mug.yaml:5: mass: "),
        (
            ("axis: [0.0, 1.0, 0.0]", "axis: [0, 99999999999, 0]"),
            "axis.1: ",
        ),
        (("name: Coffee mug", 'name: "a\\x01b"'), "mug.yaml:4: name: "),
        (("name: Coffee mug", "name: 2024-02-31"), "value"),
        (("mass: 0.31", "mass: !!int heavy"), "tagged"),
        (("mass: 0.31", "? [mass, 1]\n: 0.31"), "mug.yaml: line 5: "),
        (("mass: 0.31", "mass: " + "[" * 40_000), "mug.yaml: line 5: "),
        (
            ("mode: cylindrical, level: medium", "mode: lateral, level: medium"),
            "grasps.side.hand.level: ",
        ),
    ],
)
def test_bad_files_name_place_and_field(change, sentence):
    with pytest.raises(ObjectError) as error:
        parse_object(MUG.replace(*change), "mug.yaml")
    assert sentence in str(error.value)
    assert str(error.value).startswith("mug.yaml:")


def test_the_hand_s_dialect_decides_which_grasps_there_are():
    text = MUG.replace("mode: cylindrical, level: medium", "mode: lateral, level: medium")
    assert parse_object(text, "mug.yaml", "v17")["grasps"]["side"]["hand"]["level"] == "medium"


def test_each_file_is_read_once_whatever_is_wrong_with_it(tmp_path, monkeypatch):
    (tmp_path / "mug.yaml").write_text(MUG)
    (tmp_path / "bad.yaml").write_text("? [a]\n: 1\n")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "nowhere.yaml").symlink_to(tmp_path / "gone")
    (tmp_path / "folder.yaml").mkdir()
    os.mkfifo(tmp_path / "pipe.yaml")
    database = ObjectDatabase(str(tmp_path))
    problems = database.reload()
    assert [p.split(":")[0] for p in problems] == [
        f"{name}.yaml" for name in ("bad", "binary", "folder", "nowhere", "pipe")
    ]
    assert database.ids() == ["mug"] and not database.changed()
    read = []
    monkeypatch.setattr("coglab_objects.database.read_object", lambda path, dialect: read.append(path.name))
    assert database.reload(only_changed=True) == problems and read == []


def test_empty_oversize_and_python_tags_are_refused():
    for text in ("", "x" * 200_000, "!!python/object/apply:os.system ['true']"):
        with pytest.raises(ObjectError):
            parse_object(text, "x.yaml")


def test_hot_reload_keeps_the_old_entry_of_a_bad_file(tmp_path):
    path = tmp_path / "mug.yaml"
    path.write_text(MUG)
    database = ObjectDatabase(str(tmp_path))
    assert database.reload() == []
    path.write_text(MUG.replace("mass: 0.31", "mass: -3"))
    os.utime(path, ns=(5, 5))
    assert database.changed()
    problems = database.reload(only_changed=True)
    assert len(problems) == 1 and "mug.yaml" in problems[0]
    assert database.get("mug")["mass"] == 0.31
    path.write_text(MUG.replace("mass: 0.31", "mass: 0.44"))
    os.utime(path, ns=(6, 6))
    assert database.reload(only_changed=True) == []
    assert database.get("mug")["mass"] == 0.44 and not database.changed()
    path.unlink()
    database.reload()
    assert database.ids() == []


def test_an_id_must_be_its_files_name(tmp_path):
    (tmp_path / "cup.yaml").write_text(MUG)
    problems = ObjectDatabase(str(tmp_path)).reload()
    assert len(problems) == 1 and problems[0].startswith("cup.yaml:1: id: 'mug'") and "'cup'" in problems[0]


def test_missing_object_names_those_that_exist():
    database = ObjectDatabase(objects_folder())
    database.reload()
    with pytest.raises(ObjectError, match="ball, bottle, mug, screwdriver, tea_box"):
        database.get("elephant")


def test_new_object_is_valid_and_ids_are_checked(tmp_path):
    assert parse_object(new_object_text("spoon"), "spoon.yaml")["id"] == "spoon"
    with pytest.raises(ObjectError):
        new_object_text("Bad Id")


def test_the_cell_gets_the_solid_whose_underside_is_the_object_frame():
    mug = cell_parameters(parse_object(MUG, "mug.yaml"))
    assert mug == {
        "id": "mug",
        "mass": 0.31,
        "shape": "cylinder",
        "size": [0.08, 0.08, 0.10],
        "center": [0.0, 0.0, 0.05],
        "friction": 0.6,
    }
