"""Parameters: types and ranges, and the sentence where one does not fit."""

import pytest
from coglab_py import parameters
from coglab_py.parameters import ParameterError, checked, checked_numbers


@pytest.mark.parametrize(
    "value, kind, expected",
    [(True, bool, True), (3, int, 3), (3, float, 3.0), (2.5, float, 2.5), ("a", str, "a"), ({"a": 1}, dict, {"a": 1})],
)
def test_a_value_of_its_type_is_taken(value, kind, expected):
    taken = checked("/n/x", value, kind)
    assert taken == expected and type(taken) is type(expected)


@pytest.mark.parametrize(
    "value, kind, more, sentence",
    [
        (None, float, {}, "parameter /n/x is missing; expected a number"),
        ("3", float, {}, "parameter /n/x: expected a number, got '3'"),
        (True, int, {}, "expected a whole number, got 'True'"),
        (True, float, {}, "expected a number, got 'True'"),
        (1, bool, {}, "expected true or false, got '1'"),
        (0.5, int, {}, "expected a whole number"),
        (float("nan"), float, {"low": 0.0}, "expected a number in 0..inf, got 'nan'"),
        (201.0, float, {"low": 1, "high": 200}, "expected a number in 1..200, got '201.0'"),
        ("v18", str, {"among": ("legacy", "v17")}, "expected one of legacy, v17, got 'v18'"),
        ([1], dict, {}, "expected a mapping"),
    ],
)
def test_another_value_is_refused_with_a_sentence(value, kind, more, sentence):
    with pytest.raises(ParameterError) as error:
        checked("/n/x", value, kind, **more)
    assert sentence in str(error.value)


def test_lists_of_points(monkeypatch):
    given = {"/n/good": [[1, 2, 3.5]], "/n/flat": [1, 2, 3], "/n/short": [[1, 2, 3], [1, 2]], "/n/text": "1 2 3"}
    monkeypatch.setattr(parameters.rospy, "get_param", lambda name, default: given.get(name, default))
    monkeypatch.setattr(parameters.rospy, "resolve_name", lambda name: name)
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


def test_lists_of_numbers():
    assert checked_numbers("/n/x", [1, 2.5], 2) == [1.0, 2.5]
    for bad in ([1, 2, 3], [1, "2"], [1, float("inf")], "12", None, [True, 1]):
        with pytest.raises(ParameterError, match="parameter /n/x: expected a list of 2 finite numbers"):
            checked_numbers("/n/x", bad, 2)
