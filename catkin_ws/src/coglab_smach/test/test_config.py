"""machines.yaml: the shipped file fits its schema, and what does not is said with file, line, field and expectation."""

from pathlib import Path

import pytest
from coglab_smach.context.config import Config, ConfigError

SHIPPED = Path(__file__).resolve().parents[1] / "config" / "machines.yaml"


def test_the_shipped_file_fits():
    assert Config.load(str(SHIPPED)).get("hand.calibration") == "fast"


@pytest.mark.parametrize(
    "change, sentence",
    [
        (("open_speed: 400", "open_speed: 600"), "hand.open_speed: 600 is greater than the maximum of 511"),
        (("open_speed: 400", "opne_speed: 400"), "hand: Additional properties are not allowed ('opne_speed'"),
        (("calibration: fast", "calibration: slow"), "hand.calibration: 'slow' is not one of ['fast'"),
        (("ptp_tolerance: 0.03", "ptp_tolerance: little"), "ptp_tolerance: 'little' is not of type 'number'"),
        (
            ("contact_timeout: 6.0", "contact_timeout: 0"),
            "contact_timeout: 0 is less than or equal to the minimum of 0",
        ),
        (("reach_timeout: 6.0", "reach_timeout: .nan"), "reach_timeout: a finite number expected, got nan"),
        (
            ("0.2152, 0.782]", "0.2152]"),
            "postures.home: [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152] is too short",
        ),
        (("preshape: before", "preshape: after"), "take.preshape: 'after' is not one of ['before', 'during']"),
        (("time_limits: {}", "time_limits: {wait_stop: -1}"), "time_limits.wait_stop: -1 is less than or equal"),
        (("hub:", "hubs:"), "top level: Additional properties are not allowed ('hubs' was unexpected)"),
        (("auto_trigger: false", "auto_trigger: no way"), "auto_trigger: 'no way' is not of type 'boolean'"),
    ],
)
def test_what_does_not_fit_is_named_with_file_line_and_field(tmp_path, change, sentence):
    path = tmp_path / "machines.yaml"
    text = SHIPPED.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    line = text[: text.index(change[0])].count("\n") + 1
    with pytest.raises(ConfigError) as error:
        Config.load(str(path))
    assert sentence in str(error.value)
    if not sentence.startswith(("top level", "hand: ")):
        assert str(error.value).startswith(f"{path}:{line}: ")


def test_what_is_given_beside_the_file_has_to_fit_too():
    assert Config.load(str(SHIPPED), {"hand.open_speed": 100}).get("hand.open_speed") == 100
    with pytest.raises(ConfigError, match="hand.open_speed: 'fast' is not of type 'integer'"):
        Config.load(str(SHIPPED), {"hand.open_speed": "fast"})


def test_a_timing_wins_over_the_file_and_what_is_given_beside_it_wins_over_the_timing():
    natural, calm = (Config.load(str(SHIPPED), {"timing": name}) for name in ("natural", "calm"))
    assert calm.get("handover.belief") < natural.get("handover.belief")
    assert natural.get("handover.belief_request") > natural.get("handover.belief")
    assert natural.get("handover.reach_ratio") < calm.get("handover.reach_ratio")
    assert calm.get("handover.doubt") == natural.get("handover.doubt")
    assert Config.load(str(SHIPPED)).get("hand.lift_after") == natural.get("hand.lift_after")
    assert Config.load(str(SHIPPED), {"timing": "calm", "hand.lift_after": 2.0}).get("hand.lift_after") == 2.0
    calm.set("timing", "natural")
    assert calm.get("handover.belief") == natural.get("handover.belief")


@pytest.mark.parametrize(
    "name, value",
    [
        ("handover.doubt", 0.3),
        ("handover.pause", 1.5),
        ("handover.arrival_speed", 0.03),
        ("handover.feel", 0.8),
        ("handover.offer_timeout", 12.0),
        ("give.back_time", 0.4),
        ("give.lower_after", 1.0),
        ("recognition_trigger.belief", 0.75),
    ],
)
def test_a_timing_may_have_every_delay_that_studies_vary(tmp_path, name, value):
    """Only that timing, within the limits that the value has elsewhere."""
    path = tmp_path / "machines.yaml"
    text = SHIPPED.read_text().replace("    handover.belief: 0.0\n", f"    handover.belief: 0.0\n    {name}: {value}\n")
    path.write_text(text)
    shipped = Config.load(str(SHIPPED)).get(name)
    assert Config.load(str(path), {"timing": "calm"}).get(name) == value != shipped
    assert Config.load(str(path)).get(name) == Config.load(str(path), {"timing": "natural"}).get(name) == shipped
    assert Config.load(str(path), {"timing": "calm", name: shipped}).get(name) == shipped
    path.write_text(text.replace(f"    {name}: {value}\n", f"    {name}: -1.0\n"))
    with pytest.raises(ConfigError, match="-1.0 is less than (or equal to )?the minimum of 0"):
        Config.load(str(path))


def test_a_timing_has_no_settings_that_are_no_delays(tmp_path):
    path = tmp_path / "machines.yaml"
    path.write_text(SHIPPED.read_text().replace("    handover.belief: 0.0\n", "    handover.hand_margin: 0.3\n"))
    with pytest.raises(ConfigError, match="'handover.hand_margin' was unexpected"):
        Config.load(str(path))


def test_natural_is_as_it_was():
    natural = Config.load(str(SHIPPED), {"timing": "natural"})
    names = ("handover.belief", "handover.start_after", "handover.reach_ratio", "hand.lift_after", "hand.lift_speed")
    assert [natural.get(name) for name in names] == [0.85, 0.0, 1.0, 0.05, 0.055]


def test_an_unknown_timing_is_named_with_those_there_are(tmp_path):
    with pytest.raises(ConfigError, match="no timing 'hasty'; timings: calm, natural"):
        Config.load(str(SHIPPED), {"timing": "hasty"})
    path = tmp_path / "machines.yaml"
    path.write_text(SHIPPED.read_text().replace("timing: natural", "timing: hasty"))
    with pytest.raises(ConfigError, match="no timing 'hasty'"):
        Config.load(str(path))


def test_a_file_that_became_bad_keeps_the_values_read_before(tmp_path):
    import os

    path, warnings = tmp_path / "machines.yaml", []
    path.write_text("hand: {open_speed: 100}\n")
    config = Config.load(str(path), warn=warnings.append)
    path.write_text("hand: {open_speed: 1000}\n")
    os.utime(path, ns=(5, 5))
    assert config.get("hand.open_speed") == 100
    assert len(warnings) == 1 and "hand.open_speed: 1000 is greater" in warnings[0] and "stay in force" in warnings[0]


@pytest.mark.parametrize("low, field", [("[450, -500, 50]", "region_low"), ("[0.9, -0.5, 0.05]", "region_low")])
def test_a_handover_region_in_millimetres_or_upside_down_is_refused(tmp_path, low, field):
    path = tmp_path / "machines.yaml"
    path.write_text(SHIPPED.read_text().replace("region_low: [0.45, -0.50, 0.05]", f"region_low: {low}"))
    with pytest.raises(ConfigError, match=field):
        Config.load(str(path))
