"""The object database at its edges: lengths that are just right, files that come, go or stay, a folder that is none."""

import os

import pytest
from coglab_objects.database import (
    SAME_LENGTH,
    ObjectDatabase,
    ObjectError,
    cell_parameters,
    objects_folder,
    parse_object,
)

TEXTS = {name: (objects_folder() / f"{name}.yaml").read_text() for name in ("mug", "ball", "tea_box")}


def changed(name, before, after):
    """An object of those that are shipped with one thing changed."""
    assert before in TEXTS[name]
    return TEXTS[name].replace(before, after)


def refusal(text, name="mug"):
    """What is said of a text, behind the file's name and line; empty if it is taken."""
    try:
        parse_object(text, f"{name}.yaml")
    except ObjectError as error:
        return str(error).split(": ", 1)[1]
    return ""


def write(path, text, stamp):
    """A file with a time of our own: two that are written within one tick of the file system's clock look the same."""
    path.write_text(text)
    os.utime(path, ns=(stamp, stamp))


@pytest.mark.parametrize("off, taken", [(0.9e-6, True), (-0.9e-6, True), (1.1e-6, False), (-1.1e-6, False)])
def test_size_may_differ_from_the_shape_by_what_rounding_leaves(off, taken):
    assert SAME_LENGTH == 1e-6
    for i in range(3):
        size = [0.08, 0.08, 0.10]
        size[i] += off
        text = changed("mug", "size: [0.08, 0.08, 0.10]", f"size: [{', '.join(f'{v:.9f}' for v in size)}]")
        assert (refusal(text) == "") == taken
        assert taken or "size is the box around the shape, m" in refusal(text)


def test_a_box_has_any_size():
    entry = parse_object(TEXTS["tea_box"], "tea_box.yaml")
    other = {**entry, "size": [0.01, 0.02, 0.031]}
    assert cell_parameters(other)["center"] == [0.0, 0.0, 0.0155]
    assert cell_parameters(other)["size"] == [0.01, 0.02, 0.031] and cell_parameters(other)["shape"] == "box"
    assert refusal(changed("tea_box", f"size: {entry['size']}", "size: [0.01, 0.02, 0.031]"), "tea_box") == ""


@pytest.mark.parametrize(
    "kind, before", [("grasps.side", "[0.0, -0.04, 0.07]"), ("deliveries.handle_first", "[-0.09, 0.0, -0.05]")]
)
def test_a_pose_lies_at_most_a_metre_away(kind, before):
    for xyz, taken in (("[0.6, 0.0, -0.8]", True), ("[0.0, 1.0, 0.0]", True), ("[0.0, -1.001, 0.0]", False)):
        said = refusal(changed("mug", f"xyz: {before}", f"xyz: {xyz}"))
        assert said == ("" if taken else f"{kind}.pose.xyz: more than 1 m away; lengths are in m")


@pytest.mark.parametrize("axis, taken", [("[0.0, 1.1e-6, 0.0]", True), ("[0.0, 0.0, -0.9e-6]", False)])
def test_a_direction_has_a_length(axis, taken):
    said = refusal(changed("mug", "axis: [0.0, 1.0, 0.0]", f"axis: {axis}"))
    assert said == ("" if taken else "grasps.side.approach.axis: a direction must not be zero")


def test_an_approach_without_an_axis_and_a_grasp_without_an_approach_are_taken():
    assert refusal(changed("mug", "axis: [0.0, 1.0, 0.0], ", "")) == ""
    line = next(line for line in TEXTS["mug"].splitlines(keepends=True) if "approach:" in line)
    assert refusal(changed("mug", line, "")) == ""


def test_defaults_have_to_be_there():
    assert refusal(changed("mug", "default_grasp: side", "default_grasp: no")).startswith("default_grasp: ")
    line = next(line for line in TEXTS["mug"].splitlines() if line.startswith("default_delivery:"))
    assert "default_delivery: 'nowhere' is none of deliveries: " in refusal(
        changed("mug", line, "default_delivery: nowhere")
    )


def test_a_folder_that_is_none_is_told_and_what_was_read_stays(tmp_path):
    folder = tmp_path / "objects"
    folder.mkdir()
    write(folder / "mug.yaml", TEXTS["mug"], 1)
    database = ObjectDatabase(folder)
    assert database.problems == [] and database.ids() == [] and database.changed()
    assert database.reload() == [] and not database.changed()
    folder.rename(tmp_path / "away")
    told = [f"{folder}: no such folder; expected one YAML file per object in it"]
    assert database.reload() == told and database.problems == told and database.ids() == ["mug"]
    (tmp_path / "away").rename(folder)
    assert database.reload() == [] and database.problems == []


def test_a_file_that_comes_or_goes_is_a_change(tmp_path):
    database = ObjectDatabase(tmp_path)
    database.reload()
    assert not database.changed()
    write(tmp_path / "mug.yaml", TEXTS["mug"], 1)
    assert database.changed()
    database.reload(only_changed=True)
    assert database.ids() == ["mug"] and not database.changed()
    write(tmp_path / "ball.yaml", TEXTS["ball"], 1)
    (tmp_path / "notes.txt").write_text("no object")
    database.reload(only_changed=True)
    assert database.ids() == ["ball", "mug"] and not database.changed()
    (tmp_path / "mug.yaml").unlink()
    assert database.changed()
    database.reload(only_changed=True)
    assert database.ids() == ["ball"]


def test_all_is_read_again_unless_only_what_has_changed_is_asked_for(tmp_path):
    path = tmp_path / "mug.yaml"
    write(path, TEXTS["mug"], 1)
    database = ObjectDatabase(tmp_path)
    database.reload()
    write(path, changed("mug", "mass: 0.31", "mass: 0.32"), 1)  # looks the same from outside
    database.reload(only_changed=True)
    assert not database.changed() and database.get("mug")["mass"] == 0.31
    database.reload()
    assert database.get("mug")["mass"] == 0.32
    write(path, changed("mug", "mass: 0.31", "mass: 0.3333"), 1)  # same time, another size
    assert database.changed()


def test_only_a_bad_file_that_was_good_before_has_an_old_entry(tmp_path):
    path = tmp_path / "mug.yaml"
    write(path, changed("mug", "mass: 0.31", "mass: -1"), 1)
    database = ObjectDatabase(tmp_path)
    bad = "mug.yaml:5: mass: -1 is less than the minimum of 0.01"
    assert database.reload() == [bad] and database.reload() == [bad] and database.ids() == []
    with pytest.raises(ObjectError) as error:
        database.get("x" * 50)
    assert str(error.value) == f"object '{'x' * 40}' is not in the database; it has: no objects"
    write(path, TEXTS["mug"], 2)
    assert database.reload() == [] and database.text("mug") == TEXTS["mug"]
    for stamp in (3, 4):
        write(path, changed("mug", "mass: 0.31", "mass: -1"), stamp)
        assert database.reload(only_changed=True) == [f"{bad}; the old entry stays"]
        assert database.text("mug") == TEXTS["mug"] and database.get("mug")["mass"] == 0.31
