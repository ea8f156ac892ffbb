"""The object of programs that have no database is the mug of the database."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

SOURCES = Path(__file__).resolve().parents[2]
HEADER = SOURCES / "coglab_sim" / "include" / "coglab_sim" / "plant" / "scene_description.hpp"


def test_the_object_without_a_database_is_the_mug_of_the_database():
    mug = yaml.safe_load((SOURCES / "coglab_objects" / "objects" / "mug.yaml").read_text(encoding="utf-8"))
    text = HEADER.read_text(encoding="utf-8").split("struct Object {")[1].split("};")[0]

    def numbers(member: str) -> list[float]:
        value = re.search(rf"\b{member}\s*=\s*([^;]+);", text)
        assert value, member
        return [float(n) for n in re.findall(r"(?<![\w.])-?\d+\.?\d*", value.group(1).replace("Vector3d", ""))]

    assert f'id = "{mug["id"]}"' in text and f'shape = "{mug["shape"]["type"]}"' in text
    assert numbers("mass") == [mug["mass"]]
    assert numbers("size") == mug["size"]
    assert numbers("center") == [0.0, 0.0, mug["size"][2] / 2]
    assert numbers("friction") == [mug["friction"]]
