"""The cell's parameters in Python: config/cell.yaml and every object of the database fit the table."""

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
TABLE = {row["name"]: row for row in _cell.parameters()}


def test_the_shipped_configuration_is_taken():
    given = {f"{group}/{name}": value for group, names in CONFIG.items() for name, value in names.items()}
    _cell.Cell(URDF, given)


@pytest.mark.parametrize("object_id", OBJECTS)
def test_the_cell_takes_every_object_of_the_database(object_id):
    entry, _ = read_object(objects_folder() / f"{object_id}.yaml")
    _cell.Cell(URDF, {f"object/{name}": value for name, value in cell_parameters(entry).items()})


def test_the_cell_can_compute_with_every_object_that_the_database_takes():
    schema = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    fields = {"size": schema["definitions"]["length"]} | {f: schema["properties"][f] for f in ("mass", "friction")}
    for field, allowed in fields.items():
        row = TABLE[f"object/{field}"]
        assert row["low"] <= allowed["minimum"] < allowed["maximum"] <= row["high"], field


def test_the_defaults_without_a_database_are_the_mug():
    entry, _ = read_object(objects_folder() / "mug.yaml")
    for name, value in cell_parameters(entry).items():
        default = TABLE[f"object/{name}"]["default"]
        assert default == (value if name == "shape" else pytest.approx(value)), name


@pytest.mark.parametrize(
    "name, value",
    [
        ("krc/period", 0.2),
        ("krc/nonsense", 1.0),
        ("krc/convention", "nobody"),
        ("home", [0.0] * 6),
        ("object/shape", "pyramid"),
        ("krc/krl_poll", float("nan")),
        ("fri_port", 49938),
    ],
)
def test_what_does_not_fit_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name.rsplit("/", maxsplit=1)[-1].split("_")[0]):
        _cell.Cell(URDF, {name: value})
