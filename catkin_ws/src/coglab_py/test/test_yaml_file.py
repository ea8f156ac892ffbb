"""YAML files: lines, strictness, schema."""

import pytest
from coglab_py.yaml_file import DEEPEST, LARGEST_FILE, LARGEST_INTEGER, Document, YamlError, parse, read

SCHEMA = {"properties": {"a": {"properties": {"b": {"type": "number", "maximum": 5}}}}}


def test_a_field_is_named_with_its_line():
    document = parse("x: 1\na:\n  b: 7\n", "f.yaml")
    assert document.value == {"x": 1, "a": {"b": 7}}
    with pytest.raises(YamlError, match=r"^f.yaml:3: a.b: 7 is greater than the maximum of 5"):
        document.check(SCHEMA)
    assert parse("a:\n- 7\n- 8\n", "f.yaml").lines == {(): 1, ("a",): 1, ("a", 0): 2, ("a", 1): 3}
    assert document.sentence(("a", "c"), "is missing") == "f.yaml:2: a.c: is missing"


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("", "f.yaml: line 1: the file is empty"),
        ("a: [1", r"f.yaml:\d+: not YAML"),
        ("a: &x 1\nb: *x", "line 2: aliases"),
        ("a: 1\na: 2", "line 2: field 'a' appears twice"),
        ("[" * 20 + "]" * 20, "nested more than 16"),
        ("? [1]\n: 2", "name is one word"),
        ("a: 2020-13-45", "cannot be read as what it looks like"),
        ("#" * (LARGEST_FILE + 1), "at most"),
        ("a: !!python/object:x.Y {}", "not YAML"),
    ],
)
def test_what_is_refused(text, sentence):
    with pytest.raises(YamlError, match=sentence):
        parse(text, "f.yaml")


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("a: .nan", "a finite number"),
        ("a: 3000000000", "a whole number of at most"),
        ('a: "\\x07"', "control characters"),
    ],
)
def test_what_ros_cannot_carry_is_refused(text, sentence):
    with pytest.raises(YamlError, match=f"f.yaml:1: a: .*{sentence}"):
        parse(text, "f.yaml").check({})


def test_files(tmp_path):
    with pytest.raises(YamlError, match="cannot be read"):
        read(tmp_path / "none.yaml")
    with pytest.raises(YamlError, match="a file expected"):
        read(tmp_path)
    (tmp_path / "f.yaml").write_bytes(b"\xff\xfe")
    with pytest.raises(YamlError, match="cannot be read"):
        read(tmp_path / "f.yaml", "f.yaml")


def refused(text, schema=None):
    """The sentence with which a text is refused."""
    with pytest.raises(YamlError) as error:
        parse(text, "f.yaml").check(schema or {})
    return str(error.value)


def test_what_a_file_may_be():
    assert (LARGEST_FILE, DEEPEST, LARGEST_INTEGER) == (100_000, 16, 2_147_483_647)


def test_a_field_that_is_not_there_has_the_line_of_the_nearest_one_above_it():
    document = parse("# x\n\na:\n  b:\n    c: 7\n", "f.yaml")
    assert document.lines == {(): 3, ("a",): 3, ("a", "b"): 4, ("a", "b", "c"): 5}
    assert document.sentence(("a", "b", "x", "y"), "is missing") == "f.yaml:4: a.b.x.y: is missing"
    assert document.sentence(("a", "b", "c", 0), "is none") == "f.yaml:5: a.b.c.0: is none"
    assert document.sentence((), "is none") == "f.yaml:3: top level: is none"
    assert Document("f.yaml", "", None, {}).sentence(("a",), "is none") == "f.yaml:1: a: is none"


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("a: 1\nb: [1\nc: 2\n", "f.yaml:3: not YAML: "),
        ("a: 1\n\nb: *x", "f.yaml: line 3: aliases (*name) are not allowed"),
        ("a:\n  b: 1\n  c: 2\n  b: 3", "f.yaml: line 4: field 'b' appears twice"),
        ("a: 1\n? [1]\n: 2", "f.yaml: line 2: a field's name is one word, no list or mapping"),
        ("a:\n- " + "[" * 20 + "]" * 20, "f.yaml: line 2: nested more than 16 levels deep"),
        ("x" * (LARGEST_FILE + 1), "f.yaml: 100001 bytes; such a file has at most 100000"),
        ("a: \x00", "f.yaml: not YAML: "),
    ],
)
def test_what_is_refused_is_said_with_its_line(text, sentence):
    assert refused(text).startswith(sentence)


def test_what_is_just_small_and_flat_enough_is_read():
    assert parse("a: 1\n" + "#" * (LARGEST_FILE - 5), "f.yaml").value == {"a": 1}
    assert parse("[" * DEEPEST + "1" + "]" * DEEPEST, "f.yaml").value
    assert refused("[" * (DEEPEST + 1) + "1" + "]" * (DEEPEST + 1)) == "f.yaml: line 1: nested more than 16 levels deep"
    beside = parse("\n".join(f"a{i}: [{i}]" for i in range(50)), "f.yaml")
    assert beside.value["a49"] == [49] and beside.lines[("a49", 0)] == 50


@pytest.mark.parametrize("number", [LARGEST_INTEGER, -LARGEST_INTEGER, 0, 1e300, -1e-300, True])
def test_numbers_that_ros_can_carry(number):
    document = parse(f"a: [{number:.17e}]" if isinstance(number, float) else f"a: [{number}]".lower(), "f.yaml")
    document.check({})
    assert document.value == {"a": [number]}


@pytest.mark.parametrize(
    "text, sentence",
    [
        (f"a:\n- 1\n- {LARGEST_INTEGER + 1}", "f.yaml:3: a.1: a whole number of at most 2147483647 expected"),
        (f"a: {-LARGEST_INTEGER - 1}", "f.yaml:1: a: a whole number of at most 2147483647 expected"),
        ("a:\n  b: -.inf", "f.yaml:2: a.b: a finite number expected, got -inf"),
        ('a:\n  "b\\x07": 1', "f.yaml:1: a: a text without control characters expected"),
        ('a: ["b", "c\\x1b"]', "f.yaml:1: a.1: a text without control characters expected"),
    ],
)
def test_what_ros_cannot_carry_is_named_wherever_it_stands(text, sentence):
    assert refused(text) == sentence


def test_lines_and_tabs_in_a_text_are_no_control_characters():
    parse('a: "one\\n\\ttwo"', "f.yaml").check({})


def test_the_first_thing_that_does_not_fit_is_said():
    schema = {"required": ["z"], "properties": {"a": {"properties": {"b": {"type": "number"}}}}}
    assert refused("a: {b: x}", schema) == "f.yaml:1: top level: 'z' is a required property"
    assert refused("z: 1\na:\n  b: x\n  c: .nan", schema) == "f.yaml:3: a.b: 'x' is not of type 'number'"


def test_files_are_named_as_asked_and_measured_in_bytes(tmp_path):
    path = tmp_path / "f.yaml"
    path.write_text("a: 1\n" + "#" * (LARGEST_FILE - 5))
    assert read(path).origin == str(path) and read(str(path), "f.yaml").origin == "f.yaml"
    assert read(path).value == {"a": 1} and read(path).text == path.read_text()
    path.write_text("# " + "\u00e4" * (LARGEST_FILE // 2))  # two bytes each, so that as a text it is small enough
    for origin, name in (("", str(path)), ("f.yaml", "f.yaml")):
        with pytest.raises(YamlError) as error:
            read(path, origin)
        assert str(error.value) == f"{name}: 100002 bytes; such a file has at most 100000"
    with pytest.raises(YamlError) as error:
        read(tmp_path)
    assert str(error.value) == f"{tmp_path}: a file expected, it is something else"
