"""config/cell.yaml: every name is one of the table's, and every object of the database is one for the cell."""

import json
from pathlib import Path

import pytest
import yaml
from coglab_objects.database import SCHEMA_FILE, cell_parameters, objects_folder, read_object
from coglab_sim import _cell
from conftest import URDF

PACKAGE = Path(__file__).resolve().parents[1]
CONFIG = yaml.safe_load((PACKAGE / "config" / "cell.yaml").read_text())
OBJECTS = sorted(path.stem for path in objects_folder().glob("*.yaml"))


def test_names_are_known():
    names = {row["name"] for row in _cell.parameter_table()}
    given = {f"{group}/{name}": value for group in ("object", "contact") for name, value in CONFIG[group].items()}
    assert set(given) <= names
    _cell.Cell(URDF, given)
    assert set(CONFIG) == {"object", "contact"}


@pytest.mark.parametrize("object_id", OBJECTS)
def test_the_cell_takes_every_object_of_the_database(object_id):
    entry, _ = read_object(objects_folder() / f"{object_id}.yaml")
    _cell.Cell(URDF, {f"object/{name}": value for name, value in cell_parameters(entry).items()})


def test_the_cell_can_compute_with_every_object_that_the_database_takes():
    schema = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    ranges = {row["name"]: (row["low"], row["high"]) for row in _cell.parameter_table()}
    fields = {"size": schema["definitions"]["length"]} | {f: schema["properties"][f] for f in ("mass", "friction")}
    for field, allowed in fields.items():
        low, high = ranges[f"object/{field}"]
        assert low <= allowed["minimum"] < allowed["maximum"] <= high, field


def test_the_configuration_repeats_nothing_that_the_database_says():
    assert set(CONFIG["object"]) <= {"id", "start", "position", "rotation"}


NUMBERS = [row for row in _cell.parameter_table() if row["low"] < row["high"]]


def test_every_number_has_a_range_and_a_default_within():
    for row in _cell.parameter_table():
        value = row["default"]
        if isinstance(value, (str, bool)):
            continue
        assert row["low"] < row["high"], row["name"]
        for number in value if isinstance(value, list) else [value]:
            assert row["low"] <= number <= row["high"], row["name"]


@pytest.mark.parametrize("row", NUMBERS, ids=lambda row: row["name"])
def test_numbers_out_of_range_are_refused_with_name_value_and_range(row):
    width = row["high"] - row["low"]
    for bad in (row["low"] - 0.5 * width - 1.0, row["high"] + 0.5 * width + 1.0, float("nan"), float("inf")):
        value = row["default"]
        if isinstance(value, list):
            value = [*value[:-1], bad]
        elif isinstance(value, int) and bad == bad and abs(bad) < 2e9:
            value = int(bad)
        else:
            value = bad
        with pytest.raises(ValueError) as error:
            _cell.Cell(URDF, {row["name"]: value})
        text = str(error.value)
        assert row["name"] in text and f"range {row['low']:g}..{row['high']:g}" in text, text
        assert f"= {bad:g}"[:6] in text or "nan" in text or "inf" in text, text
