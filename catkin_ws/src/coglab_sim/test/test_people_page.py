"""docs/people.md has every figure of the person, with the value that the programs have."""

import importlib
import re
from pathlib import Path

import pytest
from coglab_sim import _cell
from coglab_sim.person.reach import Reach

SOURCES = Path(__file__).resolve().parents[2]
PAGE = (SOURCES.parents[1] / "docs" / "people.md").read_text(encoding="utf-8")
MODULES = ("giving", "grip", "phases", "receiving", "recorded_person", "scene", "senses", "virtual_human")
ELSEWHERE = {"GRAVITY"}
"""no figure of a person"""
PLANT = [SOURCES / "coglab_sim" / name for name in ("src/plant/plant_hands.cpp", "include/coglab_sim/plant")]


def stated(name):
    """The number that the page gives for a figure; what follows it is the unit."""
    row = re.search(rf"^\| `{re.escape(name)}` \| (-?[\d.]+)[ /|]", PAGE, re.MULTILINE)
    assert row, f"docs/people.md does not say what `{name}` is"
    return float(row.group(1))


def constants():
    """Numbers of the person's modules, each where it is defined."""
    for module in MODULES:
        path = SOURCES / "coglab_sim" / "src" / "coglab_sim" / "person" / f"{module}.py"
        loaded = importlib.import_module(f"coglab_sim.person.{module}")
        for line in re.findall(r"^([A-Z][A-Z_, ]*)(?:: [^=]+)? = ", path.read_text(encoding="utf-8"), re.MULTILINE):
            for name in line.split(", "):
                if name not in ELSEWHERE and isinstance(getattr(loaded, name), (int, float)):
                    yield f"{module}.{name}", float(getattr(loaded, name))


@pytest.mark.parametrize("name, value", sorted(constants()))
def test_figures_of_everybody(name, value):
    assert stated(name) == value


def test_the_shape_of_a_reach():
    assert stated("reach.Reach.vertical_share") == Reach.vertical_share


def test_figures_of_the_person_among_the_cells_parameters():
    rows = {r["name"]: r["default"] for r in _cell.parameter_table()}
    named = [name for name in rows if name.startswith("person/")] + ["contact/human_reach"]
    assert len(named) == 6
    for name in named:
        assert stated(name) == rows[name], name


def test_figures_of_the_person_in_the_plant():
    """All constants of the file that moves the person's hand, and the hand's mass."""
    text = PLANT[0].read_text(encoding="utf-8")
    found = dict(re.findall(r"\b(k[A-Z]\w+) = ([\d.]+)[,;]", text))
    scene = (PLANT[1] / "scene_description.hpp").read_text(encoding="utf-8")
    found["kPersonMass"] = re.search(r"kPersonMass = ([\d.]+);", scene).group(1)
    assert len(found) == 9
    for name, value in found.items():
        assert stated(name) == float(value), name
