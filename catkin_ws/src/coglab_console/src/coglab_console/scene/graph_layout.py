"""Lays out the graph of a state machine with Graphviz, once per structure; without Graphviz as rows of boxes.

Input: containers of smach introspection, path -> children and edges. Output for the page, in points with y downward:
{"size": [w, h], "boxes": containers, "nodes": states, "edges": transitions, "problem": reason if there are no edges}.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
from dataclasses import dataclass, field
from typing import Any

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
    """A quoted label for dot. Quotes, backslashes and unprintable characters become `?`."""
    return '"' + "".join(c if c.isprintable() and c not in '"\\' else "?" for c in text) + '"'


def _label(text: str) -> str:
    return text if len(text) <= MAX_LABEL else text[: MAX_LABEL - 1] + "…"


def structure_key(containers: dict[str, Container]) -> str:
    """Hash of a structure, independent of the order of its containers."""
    text = json.dumps([[c.path, c.children, c.edges] for _, c in sorted(containers.items())])
    return hashlib.sha256(text.encode()).hexdigest()


def roots(containers: dict[str, Container]) -> list[str]:
    """Containers that are not inside another one."""
    return sorted(path for path in containers if path.rsplit("/", 1)[0] not in containers)


class Layout:
    """Keeps its last layouts. `dot`: name of the program; `problem` reports a missing one."""

    def __init__(self, dot: str = "dot") -> None:
        self._dot = dot
        self._known: dict[str, dict] = {}

    def of(self, containers: dict[str, Container]) -> dict:
        """The layout of these containers. Takes up to TIME_LIMIT, so do not call it in the event loop."""
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
            paths = _paths(containers)
            done = subprocess.run(
                [program, "-Tjson"],
                input=_dot_text(containers, paths),
                capture_output=True,
                text=True,
                timeout=TIME_LIMIT,
            )
            if done.returncode != 0:
                raise ValueError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no message")
            picture = _read(json.loads(done.stdout), paths)
            _name_edges(picture, containers)
            return picture
        except (OSError, subprocess.TimeoutExpired, ValueError, KeyError, IndexError) as error:
            return _rows(containers, f"Graphviz did not lay the graph out ({str(error)[:120]}): no edges are drawn")


def _paths(containers: dict[str, Container]) -> list[str]:
    """Paths of every container and state. Their indices in this list are their names in dot's text."""
    states = [f"{c.path}/{child}" for c in containers.values() for child in c.children]
    return list(dict.fromkeys([*containers, *states]))


def _leaf_of(path: str, containers: dict[str, Container]) -> str:
    """A state inside a container, at any depth. dot's edges join states and are cut at the container's border."""
    while path in containers and containers[path].children:
        path = f"{path}/{containers[path].children[0]}"
    return path


def _dot_text(containers: dict[str, Container], paths: list[str]) -> str:
    number = {path: i for i, path in enumerate(paths)}
    lines = [
        "digraph machine {",
        "compound=true; rankdir=TB; nodesep=0.18; ranksep=0.32; fontname=sans; fontsize=11;",
        'node [shape=box, fontname=sans, fontsize=11, height=0.28, margin="0.08,0.03"];',
    ]
    for root in roots(containers):
        _write_container(root, containers, number, lines)
    for container in containers.values():
        pairs = {(start, end) for _, start, end in container.edges if start != end}
        for start, end in sorted(pair for pair in pairs if set(pair) <= set(container.children)):
            a, b = f"{container.path}/{start}", f"{container.path}/{end}"
            more = [f'comment="{number[a]} {number[b]}"']
            more += [f"ltail=cluster{number[a]}"] if a in containers else []
            more += [f"lhead=cluster{number[b]}"] if b in containers else []
            ends = f"n{number[_leaf_of(a, containers)]} -> n{number[_leaf_of(b, containers)]}"
            lines.append(f"{ends} [{', '.join(more)}];")
    return "\n".join([*lines, "}"])


def _write_container(path: str, containers: dict[str, Container], number: dict[str, int], lines: list[str]) -> None:
    lines.append(f"subgraph cluster{number[path]} {{ label={_quoted(_label(path.rsplit('/', 1)[-1]))};")
    for child in containers[path].children:
        below = f"{path}/{child}"
        if below in containers and containers[below].children:
            _write_container(below, containers, number, lines)
        else:
            lines.append(f"n{number[below]} [label={_quoted(_label(child))}];")
    lines.append("}")


def _read(drawn: dict, paths: list[str]) -> dict:
    """Converts the output of dot -Tjson, with y downward."""
    _, _, width, height = (float(word) for word in drawn["bb"].split(","))
    boxes, nodes, edges = [], [], []
    for item in drawn.get("objects", []):
        name = item["name"]
        path = paths[int(name.removeprefix("cluster").removeprefix("n"))]
        shown: dict[str, Any] = {"path": path, "label": _label(path.rsplit("/", 1)[-1])}
        if name.startswith("cluster"):
            x0, y0, x1, y1 = (float(word) for word in item["bb"].split(","))
            boxes.append({**shown, "box": _box(x0, height - y1, x1 - x0, y1 - y0)})
        else:
            x, y = (float(word) for word in item["pos"].split(","))
            w, h = 72 * float(item["width"]), 72 * float(item["height"])
            nodes.append({**shown, "box": _box(x - w / 2, height - y - h / 2, w, h)})
    for edge in drawn.get("edges", []):
        words = edge["pos"].split()
        tip = next((word[2:] for word in words if word.startswith("e,")), None)
        points = [_point(word, height) for word in words if word[0] not in "es"]
        if tip:
            points.append(_point(tip, height))
        start, end = (paths[int(word)] for word in edge["comment"].split())
        edges.append({"from": start, "to": end, "points": points})
    return {"size": [round(width, 1), round(height, 1)], "boxes": boxes, "nodes": nodes, "edges": edges, "problem": ""}


def _name_edges(picture: dict, containers: dict[str, Container]) -> None:
    """Adds to each edge the outcomes that it stands for."""
    outcomes: dict[tuple[str, str], list[str]] = {}
    for container in containers.values():
        for outcome, start, end in container.edges:
            outcomes.setdefault((f"{container.path}/{start}", f"{container.path}/{end}"), []).append(outcome)
    for edge in picture["edges"]:
        edge["outcomes"] = ", ".join(outcomes[edge["from"], edge["to"]])


def _box(x: float, y: float, w: float, h: float) -> list[float]:
    return [round(value, 1) for value in (x, y, w, h)]


def _point(text: str, height: float) -> list[float]:
    x, y = (float(word) for word in text.split(","))
    return [round(x, 1), round(height - y, 1)]


def _rows(containers: dict[str, Container], problem: str) -> dict[str, Any]:
    """Layout without edges: a row of boxes per container, nested containers below."""
    boxes: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    y, widest = 8.0, 100.0
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
