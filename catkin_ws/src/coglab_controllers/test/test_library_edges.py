"""Library files and learning at their limits: counts, sizes, blanks, whole numbers, and demonstrations at rest."""

from __future__ import annotations

from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

SYSTEM = '<system duration="1.2" alpha="4.6" stiffness="150" damping="24.5"/>'
WEIGHT, SHAPE = '<goal_weight kind="linear"/>', '<shape mapping="none"/>'
ENDS = '<start position="0 0 0" velocity="0 0 0"/><goal position="0.5 0 0"/>'
BASIS = '<basis centre="1" width="10" weight="0.1 0 0"/>'


def library(*primitives: str, version: str = ' version="1"') -> str:
    return f"<dmp_library{version}>{''.join(primitives)}</dmp_library>"


def primitive(*parts: str, name: str = 'id="p"') -> str:
    return f"<primitive {name}>{''.join(parts)}</primitive>"


def weighted(basis: int = 2, name: str = 'id="p"') -> str:
    return primitive(SYSTEM, WEIGHT, SHAPE, ENDS, BASIS * basis, name=name)


def parsed(*primitives: str, **options: str) -> cc.Library:
    made = cc.Library()
    assert made.parse(library(*primitives, **options), "file.xml") == len(primitives)
    return made


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    made = parsed(weighted())
    (tmp_path / "folder" / "inside").mkdir(parents=True)
    with pytest.raises(cc.LibraryError, match="folder:0: "):
        made.save(str(tmp_path / "folder"))
    with pytest.raises(cc.LibraryError, match="a.xml:0: "):
        made.save(str(tmp_path / "nowhere" / "a.xml"))
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
    made.save(str(tmp_path / "a.xml"))
    made.save(str(tmp_path / "a.xml"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.xml", "folder"]
    assert (tmp_path / "a.xml").read_text() == made.format()


def line(count: int = 9, step: float = 0.1, way: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    times = step * np.arange(count)
    return times, np.outer(np.linspace(0.0, way, count), [1.0, 0.0, 0.0])


def test_a_demonstration_that_is_slow_at_its_start_begins_at_rest() -> None:
    """Slower than a tenth of its mean speed over a twentieth of its samples: such a speed is noise."""
    u = np.linspace(0.0, 1.0, 241)
    jerk = u**3 * (10 - 15 * u + 6 * u**2)
    for share, rests in ((0.06, True), (0.09, False), (0.3, False)):
        primitive_ = cc.learn("a", [(u, np.outer(share * u + (1.0 - share) * jerk, [0.5, 0.0, 0.0]))])
        assert (not primitive_.start_velocity.any()) == rests, share
        if not rests:
            assert primitive_.start_velocity[0] == pytest.approx(0.5 * share, abs=0.01)
    few = np.array([0.0, 0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0, 1.0])  # of few samples, one is enough
    assert not cc.learn("a", [(np.arange(9.0), np.outer(few, [0.5, 0, 0]))], 5).start_velocity.any()


def test_demonstrations_that_are_mapped_begin_and_end_where_the_first_does() -> None:
    times, path = line(21, 0.05)
    other = np.outer(np.linspace(0.0, 0.3, 21) ** 0.5, [0.0, 0.6, 0.2]) + [1.0, 2.0, 0.5]
    for mapping in ("similarity", "upright"):
        both = cc.learn("a", [(times, path), (times, other)], 5, mapping=mapping, allow=["moving"])
        np.testing.assert_allclose(both.start, path[0], atol=1e-12)
        np.testing.assert_allclose(both.goal, path[-1], atol=1e-12)
    apart = cc.learn("a", [(times, path), (times, other)], 5, allow=["moving"])
    np.testing.assert_allclose(apart.start, 0.5 * (path[0] + other[0]), atol=1e-12)
    np.testing.assert_allclose(apart.goal, 0.5 * (path[-1] + other[-1]), atol=1e-12)
