"""Primitives and objects of the study's own: `primitives.xml` and `objects/` in its folder, beside the shipped ones.

An own primitive or object replaces a shipped one of the same name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coglab_controllers as cc
from coglab_objects.database import ObjectError, objects_folder, parse_object
from coglab_py.packages import package_path

from coglab_tools.command import CheckFailed

PRIMITIVES, OBJECTS = "primitives.xml", "objects"


@dataclass(frozen=True)
class OwnFiles:
    """Contents of the own files. They travel to the workers, which need not see the study's folder."""

    primitives: str = ""
    """text of primitives.xml; empty: none"""
    objects: Mapping[str, str] = field(default_factory=dict)
    """text by object id"""

    @staticmethod
    def read(folder: Path) -> OwnFiles:
        """Read and check them. Without any: empty. CheckFailed with file and line."""
        library = folder / PRIMITIVES
        text = ""
        try:
            if library.exists():
                cc.Library().load(str(library))
                text = library.read_text(encoding="utf-8")
            objects = {}
            for file in sorted((folder / OBJECTS).glob("*.yaml")):
                content = file.read_text(encoding="utf-8")
                entry = parse_object(content, str(file))
                if entry["id"] != file.stem:
                    raise ObjectError(f"{file}:1: id: '{entry['id']}' must be the file's name, '{file.stem}'")
                objects[file.stem] = content
        except (cc.LibraryError, ObjectError) as error:
            raise CheckFailed(str(error)) from None
        except OSError as error:
            raise CheckFailed(f"{error.filename} cannot be read: {error.strerror}") from None
        except UnicodeDecodeError as error:
            raise CheckFailed(f"{folder}: {PRIMITIVES} and {OBJECTS} are text in UTF-8: {error}") from None
        return OwnFiles(text, objects)

    def __bool__(self) -> bool:
        return bool(self.primitives or self.objects)

    @cached_property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each file, 12 hexadecimal digits, by its name in the study's folder."""
        texts = {f"{OBJECTS}/{name}.yaml": text for name, text in self.objects.items()}
        if self.primitives:
            texts[PRIMITIVES] = self.primitives
        return {name: hashlib.sha256(text.encode()).hexdigest()[:12] for name, text in texts.items()}

    @cached_property
    def primitive_names(self) -> tuple[str, ...]:
        """Names of all primitives: the shipped ones and the own ones."""
        return tuple(each.get("id", "") for each in self._library().iter("primitive"))

    @cached_property
    def object_texts(self) -> Mapping[str, str]:
        """Text of the file of each object, shipped or own, by id."""
        shipped = {file.stem: file.read_text(encoding="utf-8") for file in sorted(objects_folder().glob("*.yaml"))}
        return {**shipped, **self.objects}

    def object(self, object_id: str) -> dict[str, Any]:
        """The entry of an object. ObjectError: its file is invalid."""
        return parse_object(self.object_texts[object_id], f"{object_id}.yaml")

    def library(self) -> bytes:
        """XML of all primitives."""
        return bytes(ElementTree.tostring(self._library(), encoding="utf-8", xml_declaration=True))

    def write(self, folder: Path) -> None:
        """Write the library and all objects into ``folder``."""
        (folder / OBJECTS).mkdir(parents=True, exist_ok=True)
        (folder / PRIMITIVES).write_bytes(self.library())
        for name, text in self.object_texts.items():
            (folder / OBJECTS / f"{name}.yaml").write_text(text, encoding="utf-8")

    def _library(self) -> ElementTree.Element:
        root = ElementTree.parse(package_path("coglab_controllers", "config", PRIMITIVES)).getroot()
        if self.primitives:
            own = list(ElementTree.fromstring(self.primitives).iter("primitive"))
            names = {each.get("id") for each in own}
            for shipped in [each for each in root if each.get("id") in names]:
                root.remove(shipped)
            root.extend(own)
        return root
