"""YAML files: lines, strictness, schema."""

import pytest
from coglab_py.yaml_file import LARGEST_FILE, LARGEST_INTEGER, Document, YamlError, parse, read

SCHEMA = {"properties": {"a": {"properties": {"b": {"type": "number", "maximum": 5}}}}}


def test_a_field_is_named_with_its_line():
    document = parse("x: 1\na:\n  b: 7\n", "f.yaml")
    assert document.value == {"x": 1, "a": {"b": 7}}
    with pytest.raises(YamlError, match=r"^f.yaml:3: a.b: 7 "):
        document.check(SCHEMA)
    assert parse("a:\n- 7\n- 8\n", "f.yaml").lines == {(): 1, ("a",): 1, ("a", 0): 2, ("a", 1): 3}
    assert document.sentence(("a", "c"), "is missing") == "f.yaml:2: a.c: is missing"


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("", "f.yaml: line 1: "),
        ("a: [1", r"f.yaml:\d+: not YAML"),
        ("a: &x 1\nb: *x", "line 2: aliases"),
        ("a: 1\na: 2", "line 2: .*'a'"),
        ("[" * 20 + "]" * 20, "16"),
        ("? [1]\n: 2", "one word"),
        ("a: 2020-13-45", "value"),
        ("#" * (LARGEST_FILE + 1), "at most"),
        ("a: !!python/object:x.Y {}", "not YAML"),
    ],
)
def test_invalid_files_are_refused(text, sentence):
    with pytest.raises(YamlError, match=sentence):
        parse(text, "f.yaml")


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("a: .nan", "finite"),
        ("a: 3000000000", "whole number"),
        ('a: "\\x07"', "control characters"),
    ],
)
def test_values_that_ros_cannot_carry_are_refused(text, sentence):
    with pytest.raises(YamlError, match=f"f.yaml:1: a: .*{sentence}"):
        parse(text, "f.yaml").check({})


def test_files(tmp_path):
    with pytest.raises(YamlError, match="none.yaml"):
        read(tmp_path / "none.yaml")
    with pytest.raises(YamlError, match=tmp_path.name):
        read(tmp_path)
    (tmp_path / "f.yaml").write_bytes(b"\xff\xfe")
    with pytest.raises(YamlError, match="f.yaml"):
        read(tmp_path / "f.yaml", "f.yaml")


def test_a_missing_field_has_the_line_of_its_nearest_parent():
    document = parse("# x\n\na:\n  b:\n    c: 7\n", "f.yaml")
    assert document.lines == {(): 3, ("a",): 3, ("a", "b"): 4, ("a", "b", "c"): 5}
    assert document.sentence(("a", "b", "x", "y"), "is missing") == "f.yaml:4: a.b.x.y: is missing"
    assert document.sentence(("a", "b", "c", 0), "is none") == "f.yaml:5: a.b.c.0: is none"
    assert document.sentence((), "is none") == "f.yaml:3: top level: is none"
    assert Document("f.yaml", "", None, {}).sentence(("a",), "is none") == "f.yaml:1: a: is none"


@pytest.mark.parametrize("number", [LARGEST_INTEGER, -LARGEST_INTEGER, 0, 1e300, -1e-300, True])
def test_numbers_that_ros_can_carry(number):
    document = parse(f"a: [{number:.17e}]" if isinstance(number, float) else f"a: [{number}]".lower(), "f.yaml")
    document.check({})
    assert document.value == {"a": [number]}
