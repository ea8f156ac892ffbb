"""Files of the page: the folder `page`, and three.js and dygraphs from Debian.

A table from address to file is made at the start. No other file of the disk can be requested.
"""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from pathlib import Path

DEBIAN = Path("/usr/share/javascript")
LIBRARIES = {  # address: file below DEBIAN, Debian package
    "/lib/three/build/three.module.js": ("three/build/three.module.js", "libjs-three"),
    "/lib/three/examples/jsm/controls/OrbitControls.js": (
        "three/examples/jsm/controls/OrbitControls.js",
        "libjs-three",
    ),
    "/lib/dygraphs/dygraph.js": ("dygraphs/dygraph.min.js", "libjs-dygraphs"),
    "/lib/dygraphs/dygraph.css": ("dygraphs/dygraph.min.css", "libjs-dygraphs"),
}
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


@dataclass(frozen=True)
class PageFile:
    """One file, ready to send."""

    kind: str
    plain: bytes
    packed: bytes
    tag: str


def load(path: Path) -> PageFile:
    """Reads and packs one file."""
    plain = path.read_bytes()
    return PageFile(KINDS[path.suffix], plain, gzip.compress(plain, 9, mtime=0), hashlib.sha256(plain).hexdigest()[:20])


def load_all(page: Path, libraries: Path = DEBIAN) -> tuple[dict[str, PageFile], list[str]]:
    """Returns the files by address, and the names of missing Debian packages."""
    found = {f"/page/{path.name}": load(path) for path in sorted(page.iterdir()) if path.suffix in KINDS}
    found["/"] = found.pop("/page/index.html")
    missing = []
    for address, (name, package) in LIBRARIES.items():
        try:
            found[address] = load(libraries / name)
        except OSError:
            missing.append(package)
    return found, sorted(set(missing))
