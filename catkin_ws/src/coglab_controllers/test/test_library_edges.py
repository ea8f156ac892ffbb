"""Library files and learning at their limits: counts, sizes, blanks, whole numbers, and demonstrations at rest."""

from __future__ import annotations

import math
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

SYSTEM = '<system duration="1.2" alpha="4.6" stiffness="150" damping="24.5"/>'
WEIGHT, SHAPE = '<goal_weight kind="linear"/>', '<shape mapping="none"/>'
ENDS = '<start position="0 0 0" velocity="0 0 0"/><goal position="0.5 0 0"/>'
BASIS = '<basis centre="1" width="10" weight="0.1 0 0"/>'
SAMPLES = [f'<sample t="{0.2 * i}" position="{0.1 * i} {0.01 * i * i} 0"/>' for i in range(6)]
TRAJECTORY = f"<trajectory>{''.join(SAMPLES)}</trajectory>"


def library(*primitives: str, version: str = ' version="1"') -> str:
    return f"<dmp_library{version}>{''.join(primitives)}</dmp_library>"


def primitive(*parts: str, name: str = 'id="p"') -> str:
    return f"<primitive {name}>{''.join(parts)}</primitive>"


def weighted(basis: int = 2, name: str = 'id="p"') -> str:
    return primitive(SYSTEM, WEIGHT, SHAPE, ENDS, BASIS * basis, name=name)


def learnt(*parts: str, learn: str = '<learn basis="3"/>') -> str:
    return primitive(learn, *parts)


def parsed(*primitives: str, **options: str) -> cc.Library:
    made = cc.Library()
    assert made.parse(library(*primitives, **options), "file.xml") == len(primitives)
    return made


def refusal(text: str) -> str:
    made = cc.Library()
    with pytest.raises(cc.LibraryError) as error:
        made.parse(text, "file.xml")
    assert len(made) == 0
    return str(error.value)


def test_counts_are_taken_up_to_their_limits() -> None:
    assert len(parsed(weighted(64))["p"].centres) == 64
    assert "expected at most 64 <basis>, got 65" in refusal(library(weighted(65)))
    assert "basis: expected 2 to 64 functions, got 1" in refusal(library(weighted(1)))
    many = [weighted(name=f'id="p{i}"') for i in range(501)]
    assert len(parsed(*many[:500])) == 500
    assert "expected at most 500 primitives" in refusal(library(*many))
    assert len(parsed(learnt(TRAJECTORY * 50))) == 1
    assert "expected at most 50 trajectories" in refusal(library(learnt(TRAJECTORY * 51)))
    samples = "".join(f'<sample t="{0.001 * i:.4f}" position="{0.001 * i:.4f} 0 0"/>' for i in range(20001))
    one_more = samples.rindex("<sample")
    assert (
        len(parsed(learnt(f"<trajectory>{samples[:one_more]}</trajectory>", learn='<learn basis="2" allow="moving"/>')))
        == 1
    )
    assert "at most 20000 samples" in refusal(library(learnt(f"<trajectory>{samples}</trajectory>")))


def test_a_file_is_taken_up_to_four_mebibytes_and_an_empty_library_is_not_written(tmp_path: Path) -> None:
    text = library(weighted())
    full = text + "\n" * (4 * 2**20 - len(text))
    assert cc.Library().parse(full, "file.xml") == 1
    assert "expected at most 4194304 bytes, got 4194305" in refusal(full + "\n")
    (tmp_path / "full.xml").write_text(full)
    (tmp_path / "more.xml").write_text(full + "\n")
    assert cc.Library().load(str(tmp_path / "full.xml")) == 1
    for name, words in (
        ("more.xml", "expected at most 4194304 bytes, got 4194305"),
        ("none.xml", "cannot be read; expected an existing file"),
        (".", "expected a regular file"),
    ):
        with pytest.raises(cc.LibraryError, match=words):
            cc.Library().load(str(tmp_path / name))
    with pytest.raises(cc.LibraryError, match="at least one primitive to write"):
        cc.Library().save(str(tmp_path / "empty.xml"))
    assert not (tmp_path / "empty.xml").exists()
    assert "expected at least one <primitive>" in refusal(library())
    assert "got a zero byte" in refusal(text + "\0")


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    made = parsed(weighted())
    (tmp_path / "folder" / "inside").mkdir(parents=True)
    with pytest.raises(cc.LibraryError, match=":0: cannot be replaced"):
        made.save(str(tmp_path / "folder"))
    with pytest.raises(cc.LibraryError, match=":0: cannot be written; check that the folder exists"):
        made.save(str(tmp_path / "nowhere" / "a.xml"))
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
    made.save(str(tmp_path / "a.xml"))
    made.save(str(tmp_path / "a.xml"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.xml", "folder"]
    assert (tmp_path / "a.xml").read_text() == made.format()


def test_an_unknown_primitive_is_named_beside_those_that_are_there() -> None:
    with pytest.raises(KeyError, match="loaded are: none, call load_dmps first"):
        cc.Library()["p"]
    two = parsed(weighted(name='id="a"'), weighted(name='id="b"'))
    with pytest.raises(KeyError, match="'wave' is unknown; loaded are: a, b"):
        two["wave"]
    with pytest.raises(KeyError) as error:
        two["x" * 200]
    assert "'" + "x" * 64 + "' is unknown" in str(error.value)
    assert "a" in two and "wave" not in two and two.ids() == ["a", "b"]
    bad = cc.Primitive()
    with pytest.raises(ValueError, match="id: expected"):
        two.add(bad)
    assert two.ids() == ["a", "b"]


def test_numbers_may_stand_between_blanks_and_nothing_else() -> None:
    for number in (" 1.2", "1.2 ", "\t1.2\t", "&#10;1.2&#10;", "12e-1"):
        assert parsed(weighted().replace('duration="1.2"', f'duration="{number}"'))["p"].duration == 1.2
    for point in ("0.5 0.1 -0.2", " 0.5\t0.1&#10;-0.2 ", "5e-1  0.1\t\t-0.2"):
        made = parsed(weighted().replace('position="0.5 0 0"', f'position="{point}"'))["p"]
        np.testing.assert_array_equal(made.goal, [0.5, 0.1, -0.2])
    for number in ("", "1.2 3", "1,2", "0x10", "+1.2", "1.2x", "nan", "-inf", "1e999"):
        said = refusal(library(weighted()).replace('duration="1.2"', f'duration="{number}"'))
        assert "duration: expected one finite number, got" in said, (number, said)
    for point in ("", "0.5", "0.5 0", "0.5 0 0 0", "0.5 0 x", "x 0 0", "0.5 y 0", "inf 0 0", "0.5,0,0"):
        said = refusal(library(weighted()).replace('position="0.5 0 0"', f'position="{point}"'))
        assert "position: expected three finite numbers, got" in said, (point, said)


def test_what_is_quoted_from_a_file_is_cut_after_sixty_characters() -> None:
    for length, shown in ((60, "y" * 60), (61, "y" * 57 + "...")):
        said = refusal(library(weighted()).replace('duration="1.2"', f'duration="{"y" * length}"'))
        assert f"got '{shown}'" in said
    stranger = primitive(SYSTEM, WEIGHT, SHAPE, ENDS, BASIS * 2, f"<{'z' * 61}/>")
    assert f"unexpected <{'z' * 60}> in" in refusal(library(stranger))


def test_whole_numbers_are_whole_and_the_version_is_one() -> None:
    assert "version: expected 1, got '2'" in refusal(library(weighted(), version=' version="2"'))
    assert "version: expected 1, got ''" in refusal(library(weighted(), version=""))
    for number in ("1.5", "1000001", "-1000001"):
        said = refusal(library(learnt(TRAJECTORY, learn=f'<learn basis="{number}"/>')))
        assert f"basis: expected a whole number, got '{number}'" in said
    for number in ("1000000", "-1000000", "1", "65"):
        text = library(learnt(TRAJECTORY, learn=f'<learn basis="{number}"/>'))
        assert "basis_count: expected 2 to 64, got" in refusal(text)
    for count in (2, 64):
        assert len(parsed(learnt(TRAJECTORY, learn=f'<learn basis="{count}"/>'))["p"].centres) == count


GOOD = library(weighted())
SIGMOID = 'kind="sigmoid"'


@pytest.mark.parametrize(
    "text, words",
    [
        (library(primitive(SYSTEM, WEIGHT, SHAPE, ENDS, BASIS * 2, TRAJECTORY)), "needs a <learn> beside it"),
        (library(learnt(TRAJECTORY, BASIS)), "either <learn> with <trajectory> or <basis>, got both"),
        (library(learnt()), "at least one demonstration, got none"),
        (library(learnt(TRAJECTORY, ENDS)), "unexpected <goal> in <primitive>"),
        (library(learnt(TRAJECTORY.replace("ory><s", 'ory x="1"><s'))), "unknown attribute 'x', expected none"),
        (library(learnt(TRAJECTORY.replace("</t", "<extra/></t"))), "<extra>: expected <sample>"),
        (library(learnt(TRAJECTORY.replace("<sample t", "<point t"))), "<point>: expected <sample>"),
        (library(learnt(f"<trajectory>{''.join(SAMPLES[:4])}</trajectory>")), "trajectory: expected at least 5"),
        (library(learnt(TRAJECTORY.replace('t="0.2"', 't="0.0"'))), "sample 1 t: expected times that increase, got 0"),
        (library(learnt(TRAJECTORY.replace('t="0.2"', 't="0.2" t="0.3"'))), "file.xml:1:"),
        (library(learnt(TRAJECTORY.replace("ory><s", "ory>words<s"))), "expected elements, got 'words'"),
        (library(learnt(TRAJECTORY.replace('0.1 0.01 0"/>', '0.1 0.01 0">x</sample>'))), "expected elements, got 'x'"),
        (GOOD.replace("/><goal_w", ">x</system><goal_w"), "expected elements, got 'x'"),
        (GOOD.replace('weight="0.1 0 0"/>', 'weight="0.1 0 0">x</basis>'), "expected elements, got 'x'"),
        (GOOD.replace("<primitive", "x<primitive"), "expected elements, got 'x'"),
        (GOOD.replace('kind="linear"', 'kind="linear" centre="0.5"'), f"centre and steepness need {SIGMOID}"),
        (GOOD.replace('kind="linear"', 'kind="linear" steepness="5"'), f"centre and steepness need {SIGMOID}"),
        (GOOD.replace('kind="linear"', f'{SIGMOID} centre="0.5"'), "attribute 'steepness' is missing"),
        (GOOD.replace('kind="linear"', f'{SIGMOID} steepness="5"'), "attribute 'centre' is missing"),
        (GOOD.replace('width="10"', 'width="10" w="1"'), "unknown attribute 'w', expected centre, weight, width"),
        (GOOD.replace(SHAPE, SHAPE * 2), "<shape> is there twice"),
        (GOOD.replace(SYSTEM, ""), "<system> is missing"),
        (GOOD + "<more/>", "expected one root element, got <more>"),
        (GOOD.replace('id="p"', 'id="p" id="q"'), "file.xml:1:"),
        ("", "file.xml:"),
    ],
)
def test_each_kind_of_mistake_is_refused_in_words(text: str, words: str) -> None:
    assert words in refusal(text)


def test_comments_a_header_and_what_may_be_left_out_are_fine() -> None:
    text = "<?xml version='1.0'?><!-- a -->" + library("<!-- b -->", weighted()).replace("<system", "<!-- c --><system")
    assert cc.Library().parse(text, "file.xml") == 1
    assert cc.Library().parse(text) == 1, "the name is for messages alone"
    still = parsed(weighted().replace(' velocity="0 0 0"', ""))["p"]
    np.testing.assert_array_equal(still.start_velocity, [0, 0, 0])
    assert still.description == "" and parsed(weighted(name='id="p" description="d"'))["p"].description == "d"
    weight = '<goal_weight kind="sigmoid" centre="0.4" steepness="8"/>'
    options = '<learn basis="3" alpha="3" stiffness="100"/>'
    made = parsed(learnt(TRAJECTORY, weight, '<shape mapping="upright"/>', learn=options))["p"]
    assert (made.goal_weight.kind, made.goal_weight.centre, made.goal_weight.steepness) == ("sigmoid", 0.4, 8.0)
    assert (made.mapping, made.alpha, made.stiffness, made.damping) == ("upright", 3.0, 100.0, 20.0)
    plain = parsed(learnt(TRAJECTORY, learn="<learn/>"))["p"]
    times, path = [0.2 * i for i in range(6)], [[0.1 * i, 0.01 * i * i, 0.0] for i in range(6)]
    same = cc.learn("p", [(times, path)], 20, math.log(100.0), 150.0, cc.GoalWeight(), "none", 1e-6)
    np.testing.assert_allclose(plain.weights, same.weights, atol=1e-12)
    np.testing.assert_allclose(cc.learn("p", [(times, path)]).weights, same.weights, atol=1e-12)
    assert plain.alpha == pytest.approx(same.alpha) and (plain.stiffness, plain.mapping) == (150.0, "none")


def line(count: int = 9, step: float = 0.1, way: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    times = step * np.arange(count)
    return times, np.outer(np.linspace(0.0, way, count), [1.0, 0.0, 0.0])


def test_demonstrations_are_taken_within_their_limits() -> None:
    for count, step in ((5, 0.1), (9, 0.05 / 8), (9, 600.0 / 8)):
        cc.learn("a", [line(count, step, 0.02)], 3, allow=["short", "brief"])
    for count, step, words in (
        (4, 0.1, "demonstration 1: trajectory: expected at least 5 samples, got 4"),
        (9, 0.0499 / 8, "trajectory duration: expected a number from 0.05 to 600"),
        (9, 600.1 / 8, "trajectory duration: expected a number from 0.05 to 600"),
    ):
        with pytest.raises(ValueError, match=words):
            cc.learn("a", [line(count, step)], 3)
    times, path = line()
    for shift, fine in ((1e10 - 0.9, True), (-1e10, True), (1.1e10, False), (-1.1e10, False)):
        if fine:
            cc.learn("a", [(times + shift, path)], 3)
            continue
        with pytest.raises(ValueError, match=r"demonstration 2: sample 0 t: expected a number from -1e\+10 to 1e\+10"):
            cc.learn("a", [(times, path), (times + shift, path)], 3)
    for axis in range(3):
        for way in (100.5, -100.5):
            bad = path.copy()
            bad[4, axis] = way
            with pytest.raises(
                ValueError, match=f"sample 4 position.{'xyz'[axis]}: expected a number from -100 to 100"
            ):
                cc.learn("a", [(times, bad)], 3)
    with pytest.raises(ValueError, match=r"one position per time \(9\), got 8"):
        cc.learn("a", [(times, path[:8])], 3)
    cc.learn("a", [line(way=1.01e-4)], 3, allow=["short"])
    with pytest.raises(ValueError, match="expected a path of at least 0.1 mm, got one of 0.000099 m"):
        cc.learn("a", [line(way=0.99e-4)], 3)
    for count in (2, 64):
        assert cc.learn("a", [line()], count).weights.shape == (count, 3)
    for count in (1, 65):
        with pytest.raises(ValueError, match=f"basis_count: expected 2 to 64, got {count}"):
            cc.learn("a", [line()], count)
    for fine in (0.0, 1.0):
        cc.learn("a", [line()], 3, regularisation=fine)
    for bad_ridge in (-1e-9, 1.0 + 1e-9, math.nan):
        with pytest.raises(ValueError, match="regularisation: expected 0 to 1"):
            cc.learn("a", [line()], 3, regularisation=bad_ridge)


def test_a_demonstration_that_is_slow_at_its_start_begins_at_rest() -> None:
    """Slower than a tenth of its mean speed over a twentieth of its samples: what else there is, is noise."""
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


def test_a_basis_is_spread_over_the_time_of_the_motion() -> None:
    for count, alpha in ((2, 3.0), (7, math.log(100.0))):
        made = cc.learn("a", [line()], count, alpha)
        centres = np.exp(-alpha * np.arange(count) / (count - 1))
        gaps = -np.diff(centres)
        np.testing.assert_allclose(made.centres, centres, rtol=1e-12)
        np.testing.assert_allclose(made.widths, 1.0 / np.append(gaps, gaps[-1]) ** 2, rtol=1e-12)
        assert made.alpha == alpha and made.damping == pytest.approx(2.0 * math.sqrt(made.stiffness))
    times = [0.4, 0.4, 0.9]
    np.testing.assert_array_equal(cc.reproduce(made, times)[0], cc.reproduce(made, times)[1])
    assert cc.reproduce(made, []).shape == (0, 3)
