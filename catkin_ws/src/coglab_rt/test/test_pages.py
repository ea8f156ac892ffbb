"""The page docs/arm_back_end.md shows the example that is compiled, and every name of the port."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
PAGE = PACKAGE.parents[2] / "docs" / "arm_back_end.md"


def test_the_page_shows_the_example_that_is_compiled() -> None:
    blocks = re.findall(r"^```cpp\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    example = (PACKAGE / "example" / "shortest_arm.hpp").read_text(encoding="utf-8")
    assert example in blocks


def test_every_name_of_the_port_is_on_the_page() -> None:
    header = (PACKAGE / "include" / "coglab_rt" / "arm_port.hpp").read_text(encoding="utf-8")
    names = set(re.findall(r"(\w+)\([^;{)]*\)(?: =|;| \{)", header)) - {"ArmPort", "read", "write"}
    assert {"start", "shutdown", "mailboxes", "setControllerActive", "publishSample"} <= names
    page = PAGE.read_text(encoding="utf-8")
    assert not [name for name in names if f"`{name}" not in page and f"::{name}" not in page]
