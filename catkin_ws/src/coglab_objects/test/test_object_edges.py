"""Edge cases of the object database: lengths at the tolerance, added and removed files, a missing folder."""

import os

from coglab_objects.database import (
    ObjectDatabase,
    ObjectError,
    cell_parameters,
    objects_folder,
    parse_object,
)

TEXTS = {name: (objects_folder() / f"{name}.yaml").read_text() for name in ("mug", "ball", "tea_box")}


def changed(name, before, after):
    """A shipped object with one change."""
    assert before in TEXTS[name]
    return TEXTS[name].replace(before, after)


def refusal(text, name="mug"):
    """The error for a text, without file name and line; empty if the text is valid."""
    try:
        parse_object(text, f"{name}.yaml")
    except ObjectError as error:
        return str(error).split(": ", 1)[1]
    return ""


def write(path, text, stamp):
    """A file with a time of our own: two that are written within one tick of the file system's clock look the same."""
    path.write_text(text)
    os.utime(path, ns=(stamp, stamp))


def test_a_box_has_any_size():
    entry = parse_object(TEXTS["tea_box"], "tea_box.yaml")
    other = {**entry, "size": [0.01, 0.02, 0.031]}
    assert cell_parameters(other)["center"] == [0.0, 0.0, 0.0155]
    assert cell_parameters(other)["size"] == [0.01, 0.02, 0.031] and cell_parameters(other)["shape"] == "box"
    assert refusal(changed("tea_box", f"size: {entry['size']}", "size: [0.01, 0.02, 0.031]"), "tea_box") == ""


def test_an_approach_without_an_axis_and_a_grasp_without_an_approach_are_taken():
    assert refusal(changed("mug", "axis: [0.0, 1.0, 0.0], ", "")) == ""
    line = next(line for line in TEXTS["mug"].splitlines(keepends=True) if "approach:" in line)
    assert refusal(changed("mug", line, "")) == ""


def test_missing_folder_is_reported_and_old_entries_stay(tmp_path):
    folder = tmp_path / "objects"
    folder.mkdir()
    write(folder / "mug.yaml", TEXTS["mug"], 1)
    database = ObjectDatabase(folder)
    assert database.problems == [] and database.ids() == [] and database.changed()
    assert database.reload() == [] and not database.changed()
    folder.rename(tmp_path / "away")
    (told,) = database.reload()
    assert str(folder) in told and database.problems == [told] and database.ids() == ["mug"]
    (tmp_path / "away").rename(folder)
    assert database.reload() == [] and database.problems == []


def test_reload_reads_all_files_or_only_changed_ones(tmp_path):
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
