"""The rows of ./coglab bench fri about latency: missing answers are those of every packet, a shortened run is a sample,
and the node is the one that is launched by default."""

from __future__ import annotations

import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_fri

LAUNCH = Path(bench_fri.__file__).with_name("fri.launch")
BLOCKS = [(kind, [50.0] * 500) for kind in ("echo", "bridge", "bridge", "echo")]
EVERY = {"bridge": [2000, 0, 0, 0], "echo": [2000, 0, 0, 0]}


def missing_row(counts: dict[str, list[int]]) -> dict[str, object]:
    """The row about answers that did not come."""
    (row,) = [row for row in bench_fri.figures("here", BLOCKS, counts) if row["unit"] == "packets"]
    return row


@pytest.mark.parametrize("before", [0, 1], ids=["beside a block of the echo", "before the motion"])
def test_an_answer_that_is_missing_outside_the_bridges_own_blocks_makes_its_row_missed(before):
    fine = missing_row(EVERY)
    assert fine["ok"] and fine["value"] == 0 and "all 2000 packets" in fine["figure"]
    row = missing_row({"bridge": [2500, 1, 1, before], "echo": [2500, 3, 0, 0]})
    assert not row["ok"] and (row["value"], row["peer_value"]) == (1, 3)
    assert f"({before} of them before the blocks; 1 came late)" in row["figure"]


def test_every_row_of_a_shortened_run_is_a_sample(monkeypatch):
    monkeypatch.setattr(bench_fri, "QUADS", 2)
    rows = [*bench_fri.figures("here", BLOCKS, EVERY), bench_fri.share_row("here", 0.9)]
    assert {(row["done"], row["asked"]) for row in rows} == {(2, 40)}


def test_the_node_is_the_one_of_the_default_launch_but_for_its_port():
    root = ElementTree.parse(LAUNCH).getroot()
    assert [element.tag for element in root] == ["include"]
    assert [argument.attrib for argument in root.iter("arg")] == [{"name": "fri_port", "value": "0"}]
