"""Sphinx configuration of the documentation site; docs/build.py runs it."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PACKAGES = ("coglab_rt", "lwr_fri_bridge", "ctrl_more", "coglab_controllers", "coglab_sim")

project = "CogLab"
author = "CogLab authors"
copyright = "CogLab authors, MIT licence"
release = re.search(r"<version>([\d.]+)", (DOCS / "../catkin_ws/src/coglab_msgs/package.xml").read_text()).group(1)

extensions = ["myst_parser", "sphinx.ext.autodoc", "breathe"]
root_doc = "index"
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"CogLab {release}"
html_show_sourcelink = False
autodoc_member_order = "bysource"
autodoc_mock_imports = ["gymnasium"]  # of PyPI; the pages need its names alone
autodoc_typehints = "none"
breathe_projects = {package: str(DOCS / "_build" / "doxygen" / package / "xml") for package in PACKAGES}
breathe_default_project = PACKAGES[0]


def plain(_app, _what, _name, _obj, _options, lines):
    """Escape the markup of docstrings: they are plain text with names in backticks, and examples after `::`."""
    text, example, bullet = [], False, False
    for number, line in enumerate(lines):
        if example and (not line.strip() or line.startswith(" ")):
            text.append(line)
            continue
        if example and not any(text[-1:]):  # an example up to the end, at the margin of the text
            text += [f"    {rest}" for rest in lines[number:]]
            break
        example = line.rstrip().endswith("::")
        bullet = line.startswith("- ") or (bullet and line.startswith(" "))
        parts = re.split(r"(`+[^`]+`+)", line.strip())
        text.append(("  " if bullet and line.startswith(" ") else "") + "".join(_name_or_text(part) for part in parts))
    lines[:] = text


def _name_or_text(part: str) -> str:
    if part.startswith("`") and part.endswith("`") and len(part) > 2:
        return f"``{part.strip('`')}``"
    return re.sub(r"([\\*|`_])", r"\\\1", part)


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", plain)
