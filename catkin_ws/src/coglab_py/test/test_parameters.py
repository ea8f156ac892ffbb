"""Parameters: types, ranges, and the messages for invalid ones."""

import pytest
from coglab_py import parameters
from coglab_py.parameters import ParameterError, checked, checked_numbers


@pytest.mark.parametrize(
    "value, kind, expected",
    [(True, bool, True), (3, int, 3), (3, float, 3.0), (2.5, float, 2.5), ("a", str, "a"), ({"a": 1}, dict, {"a": 1})],
)
def test_a_value_of_the_right_type_is_accepted(value, kind, expected):
    taken = checked("/n/x", value, kind)
    assert taken == expected and type(taken) is type(expected)


@pytest.mark.parametrize(
    "value, kind, more, sentence",
    [
        (None, float, {}, "/n/x is missing"),
        ("3", float, {}, "/n/x: expected a number"),
        (True, int, {}, "whole number, got 'True'"),
        (True, float, {}, "a number, got 'True'"),
        (1, bool, {}, "true or false, got '1'"),
        (0.5, int, {}, "whole number"),
        (float("nan"), float, {"low": 0.0}, "0..inf, got 'nan'"),
        (201.0, float, {"low": 1, "high": 200}, "1..200, got '201.0'"),
        ("v18", str, {"among": ("legacy", "v17")}, "legacy, v17, got 'v18'"),
        ([1], dict, {}, "expected a mapping"),
    ],
)
def test_another_value_is_refused_with_a_sentence(value, kind, more, sentence):
    with pytest.raises(ParameterError) as error:
        checked("/n/x", value, kind, **more)
    assert sentence in str(error.value)


@pytest.fixture
def server(monkeypatch):
    """Contents of the parameter server by full names; empty at first."""
    given = {}
    monkeypatch.setattr(parameters.rospy, "get_param", lambda name, default=None: given.get(name, default))
    monkeypatch.setattr(parameters.rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(
        parameters.rospy, "search_param", lambda name: f"/above/{name}" if f"/above/{name}" in given else None
    )
    return given


def test_lists_of_points(server):
    server.update({"/n/good": [[1, 2, 3.5]], "/n/flat": [1, 2, 3], "/n/short": [[1, 2, 3], [1, 2]], "/n/text": "1 2 3"})
    assert parameters.points("/n/good", []) == [[1.0, 2.0, 3.5]]
    assert parameters.points("/n/none", [[0, 0, 1]]) == [[0.0, 0.0, 1.0]]
    for name, sentence in (
        ("/n/flat", "parameter /n/flat[0]: expected a list of 3 finite numbers"),
        ("/n/short", "parameter /n/short[1]: expected a list of 3 finite numbers"),
        ("/n/text", "parameter /n/text: expected a list of points, got '1 2 3'"),
    ):
        with pytest.raises(ParameterError) as error:
            parameters.points(name, [])
        assert sentence in str(error.value)


def test_reading_a_parameter_with_range_default_and_choice(server):
    server.update({"/n/count": 3, "/n/low": -1e9, "/n/high": 1e9, "/n/word": "v17", "/n/map": {"a": 1}})
    assert parameters.read("/n/count", int) == 3
    assert parameters.read("/n/low", float) == -1e9 and parameters.read("/n/high", float) == 1e9
    assert parameters.read("/n/word", str, "legacy", among=("legacy", "v17")) == "v17"
    assert parameters.read("/n/map", dict) == {"a": 1}
    assert parameters.read("/n/none", float, 2.5, 0.0, 2.5) == 2.5
    for refused in (
        lambda: parameters.read("/n/none", int),
        lambda: parameters.read("/n/count", int, 1, 4),
        lambda: parameters.read("/n/count", int, 1, high=2),
        lambda: parameters.read("/n/none", float, 2.6, 0.0, 2.5),
        lambda: parameters.read("/n/word", str, "legacy", among=("legacy",)),
    ):
        with pytest.raises(ParameterError):
            refused()


def test_the_nearest_parameter_above_or_none(server):
    assert parameters.found_above("port", int) is None
    server["/above/port"] = 7
    assert parameters.found_above("port", int) == 7
    server["/above/port"] = "seven"
    with pytest.raises(ParameterError, match="/above/port.*'seven'"):
        parameters.found_above("port", int)


def test_lists_of_any_length(server):
    server["/n/x"] = [1, 2, 3.5]
    assert parameters.numbers("/n/x") == [1.0, 2.0, 3.5] and parameters.numbers("/n/x", length=3) == [1.0, 2.0, 3.5]
    assert parameters.numbers("/n/none", [4]) == [4.0]
    assert checked_numbers("/n/x", []) == [] and checked_numbers("/n/x", (1, 2)) == [1.0, 2.0]
    assert all(type(number) is float for number in parameters.numbers("/n/x"))
    for refused in (lambda: parameters.numbers("/n/none"), lambda: parameters.numbers("/n/x", length=2)):
        with pytest.raises(ParameterError):
            refused()
