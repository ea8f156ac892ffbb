"""Lays the graph of a state machine out with Graphviz, once per structure; without Graphviz as rows of boxes.

Input are the containers as smach introspection tells them: path -> children and edges. Output, for the page, in points
with y downward: {"size": [w, h], "boxes": containers, "nodes": states, "edges": transitions, "problem": why plain}.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
from dataclasses import dataclass, field

TIME_LIMIT = 5.0  # s, for dot
MAX_STATES = 400
MAX_LABEL = 64


@dataclass(frozen=True)
class Container:
    """One container: labels of its states and (outcome, from, to) of its edges."""

    path: str
    children: tuple[str, ...]
    edges: tuple[tuple[str, str, str], ...] = field(default=())


def _quoted(text: str) -> str:
    cleaned = "".join(c if c.isprintable() else "?" for c in text[:200])
    return '"' + cleaned.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _label(text: str) -> str:
    return text if len(text) <= MAX_LABEL else text[: MAX_LABEL - 1] + "…"


def structure_key(containers: dict[str, Container]) -> str:
    """The same for the same structure, whatever the order in which it was told."""
    text = json.dumps([[c.path, c.children, c.edges] for _, c in sorted(containers.items())])
    return hashlib.sha256(text.encode()).hexdigest()


def roots(containers: dict[str, Container]) -> list[str]:
    """Containers that lie in no other one."""
    return sorted(path for path in containers if path.rsplit("/", 1)[0] not in containers)


class Layout:
    """Remembers what it laid out last. `dot`: program; one that is missing is told in `problem`."""

    def __init__(self, dot: str = "dot") -> None:
        self._dot = dot
        self._known: dict[str, dict] = {}

    def of(self, containers: dict[str, Container]) -> dict:
        """The picture of these containers. May take a while: not for the event loop."""
        key = structure_key(containers)
        if key not in self._known:
            if len(self._known) > 16:
                self._known.clear()
            self._known[key] = self._lay_out(containers)
        return self._known[key]

    def _lay_out(self, containers: dict[str, Container]) -> dict:
        count = sum(len(c.children) for c in containers.values())
        if count > MAX_STATES:
            return _rows(containers, f"{count} states are more than {MAX_STATES}: no edges are drawn")
        program = shutil.which(self._dot)
        if program is None:
            return _rows(containers, "Graphviz is missing (apt install graphviz): no edges are drawn")
        try:
            done = subprocess.run([program, "-Tjson"], input=_dot_text(containers), capture_output=True, text=True,
                                  timeout=TIME_LIMIT)  # fmt: skip
            if done.returncode != 0:
                raise ValueError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no message")
            return _read(json.loads(done.stdout))
        except (OSError, subprocess.TimeoutExpired, ValueError, KeyError, IndexError) as error:
            return _rows(containers, f"Graphviz did not lay the graph out ({str(error)[:120]}): no edges are drawn")


def _leaf_of(path: str, containers: dict[str, Container]) -> str:
    """A state inside a container, however deep: edges end at states, and are cut at the container's border."""
    while path in containers and containers[path].children:
        path = f"{path}/{containers[path].children[0]}"
    return path


def _dot_text(containers: dict[str, Container]) -> str:
    lines = ["digraph machine {", "compound=true; rankdir=TB; nodesep=0.18; ranksep=0.32; fontname=sans; fontsize=11;",
             "node [shape=box, fontname=sans, fontsize=11, height=0.28, margin=\"0.08,0.03\"];",
             "edge [fontname=sans, fontsize=9];"]  # fmt: skip
    for root in roots(containers):
        _write_container(root, containers, lines)
    for container in containers.values():
        seen: dict[tuple[str, str], list[str]] = {}
        for outcome, start, end in container.edges:
            if start in container.children and end in container.children and start != end:
                seen.setdefault((start, end), []).append(outcome)
        for (start, end), outcomes in seen.items():
            a, b = f"{container.path}/{start}", f"{container.path}/{end}"
            more = [f"tooltip={_quoted(', '.join(outcomes))}", f"comment={_quoted(a + ' ' + b)}"]
            more += [f"ltail={_quoted('cluster' + a)}"] if a in containers else []
            more += [f"lhead={_quoted('cluster' + b)}"] if b in containers else []
            ends = f"{_quoted(_leaf_of(a, containers))} -> {_quoted(_leaf_of(b, containers))}"
            lines.append(f"{ends} [{', '.join(more)}];")
    return "\n".join([*lines, "}"])


def _write_container(path: str, containers: dict[str, Container], lines: list[str]) -> None:
    name = path.rsplit("/", 1)[-1]
    lines.append(f"subgraph {_quoted('cluster' + path)} {{ label={_quoted(_label(name))}; comment={_quoted(path)};")
    for child in containers[path].children:
        below = f"{path}/{child}"
        if below in containers and containers[below].children:
            _write_container(below, containers, lines)
        else:
            lines.append(f"{_quoted(below)} [label={_quoted(_label(child))}];")
    lines.append("}")


def _read(drawn: dict) -> dict:
    """What dot -Tjson printed, y turned downward."""
    _, _, width, height = (float(word) for word in drawn["bb"].split(","))
    boxes, nodes, edges = [], [], []
    names = {item["_gvid"]: item["name"] for item in drawn.get("objects", [])}
    for item in drawn.get("objects", []):
        if "bb" in item:
            x0, y0, x1, y1 = (float(word) for word in item["bb"].split(","))
            label = item.get("label", "")
            boxes.append({"path": item["comment"], "label": label, "box": _box(x0, height - y1, x1 - x0, y1 - y0)})
        elif "pos" in item:
            x, y = (float(word) for word in item["pos"].split(","))
            w, h = 72 * float(item["width"]), 72 * float(item["height"])
            nodes.append({"path": item["name"], "label": item["label"], "box": _box(x - w / 2, height - y - h / 2, w, h)})
    for edge in drawn.get("edges", []):
        words = edge["pos"].split()
        tip = next((word[2:] for word in words if word.startswith("e,")), None)
        points = [_point(word, height) for word in words if word[0] not in "es"]
        if tip:
            points.append(_point(tip, height))
        pair = edge.get("comment", "").split(" ")
        start, end = pair if len(pair) == 2 else (names[edge["tail"]], names[edge["head"]])
        edges.append({"from": start, "to": end, "outcomes": edge.get("tooltip", ""), "points": points})
    return {"size": [round(width, 1), round(height, 1)], "boxes": boxes, "nodes": nodes, "edges": edges, "problem": ""}


def _box(x: float, y: float, w: float, h: float) -> list[float]:
    return [round(value, 1) for value in (x, y, w, h)]


def _point(text: str, height: float) -> list[float]:
    x, y = (float(word) for word in text.split(","))
    return [round(x, 1), round(height - y, 1)]


def _rows(containers: dict[str, Container], problem: str) -> dict:
    """A row of boxes per container, nested ones below; legible, but no edges."""
    boxes, nodes, y, widest = [], [], 8.0, 100.0
    for path in sorted(containers)[:60]:
        container, x, top = containers[path], 12.0, y
        boxes.append({"path": path, "label": _label(path), "box": [4.0, top, 0.0, 52.0]})
        for child in container.children[:40]:
            width = 7.0 * min(len(child), MAX_LABEL) + 14
            nodes.append({"path": f"{path}/{child}", "label": _label(child), "box": [x, top + 22, width, 22.0]})
            x += width + 6
        widest = max(widest, x + 6)
        y += 60
    for box in boxes:
        box["box"][2] = widest - 8
    return {"size": [widest, y], "boxes": boxes, "nodes": nodes, "edges": [], "problem": problem}
