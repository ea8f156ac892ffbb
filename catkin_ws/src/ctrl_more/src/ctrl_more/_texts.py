"""Gives the methods of the compiled module the texts of its stub `_core.pyi`, so that `help()` shows them."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def add_texts(module: Any) -> None:
    """Add the docstrings of the stub to classes and functions of the module. Without a stub, nothing happens."""
    stub = Path(__file__).with_name("_core.pyi")
    if stub.is_file():
        _add(module, vars(module), ast.parse(stub.read_text(encoding="utf-8")).body)


def _add(module: Any, owner: Mapping[str, Any], body: list[ast.stmt]) -> None:
    texts: dict[str, list[str]] = {}
    for each in body:
        if isinstance(each, ast.ClassDef) and each.name in owner:
            _add(module, vars(owner[each.name]), each.body)
        elif isinstance(each, ast.FunctionDef) and each.name in owner and not each.name.startswith("_"):
            texts.setdefault(each.name, []).append(ast.get_docstring(each) or "")
    for name, lines in texts.items():
        text = "\n".join(filter(None, lines))
        if not text:
            continue
        if isinstance(owner[name], property):
            owner[name].__doc__ = text
        else:
            module._set_doc(owner[name], f"{owner[name].__doc__ or ''}\n{text}")
