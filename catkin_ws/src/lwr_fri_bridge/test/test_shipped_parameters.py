"""config/lwr.yaml against the tables of parameters: what is shipped is what they call the default."""

from __future__ import annotations

import pathlib
import re

import pytest
import yaml

PACKAGE = pathlib.Path(__file__).parents[1]
SHIPPED = yaml.safe_load((PACKAGE / "config" / "lwr.yaml").read_text())
README = PACKAGE / "README.md"
REFERENCE = PACKAGE.parents[2] / "docs" / "reference.md"


def flat(parameters: dict, prefix: str = "") -> dict[str, object]:
    """Nested parameters by their whole names, such as set_point_leash/load."""
    named: dict[str, object] = {}
    for key, value in parameters.items():
        named |= flat(value, f"{prefix}{key}/") if isinstance(value, dict) else {prefix + key: value}
    return named


def documented(page: pathlib.Path) -> dict[str, str]:
    """The defaults of the first table that names fri_address; a row may hold several names with as many defaults."""
    lines = page.read_text().splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("| `fri_address` |"))
    defaults: dict[str, str] = {}
    for line in lines[first:]:
        if not line.startswith("|"):
            break
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        names = re.findall(r"`([^`]+)`", cells[0])
        # A name that begins with a slash continues that of the first one.
        names = [names[0].rsplit("/", 1)[0] + name if name.startswith("/") else name for name in names]
        values = cells[1].split(", ") if len(names) > 1 else [cells[1]]
        defaults |= dict(zip(names, values, strict=True))
    return defaults


@pytest.mark.parametrize("page", [README, REFERENCE], ids=lambda page: page.name)
@pytest.mark.parametrize("name", flat(SHIPPED))
def test_what_is_shipped_is_the_documented_default(name: str, page: pathlib.Path) -> None:
    value, told = flat(SHIPPED)[name], documented(page)[name]
    word = re.split(r"[ ;]", told)[0]  # a unit or a remark may follow
    assert (float(word) if isinstance(value, float | int) else word) == value
