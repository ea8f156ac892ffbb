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
    natural, brisk, calm = (Config.load(str(SHIPPED), {"timing": name}) for name in ("natural", "brisk", "calm"))
    assert calm.get("handover.belief") < brisk.get("handover.belief") < natural.get("handover.belief")
    assert natural.get("handover.belief_request") > natural.get("handover.belief")
    assert brisk.get("handover.reach_ratio") < natural.get("handover.reach_ratio") < calm.get("handover.reach_ratio")
    assert calm.get("handover.doubt") == brisk.get("handover.doubt")
    assert Config.load(str(SHIPPED)).get("hand.lift_after") == natural.get("hand.lift_after")
    assert Config.load(str(SHIPPED), {"timing": "calm", "hand.lift_after": 2.0}).get("hand.lift_after") == 2.0
    calm.set("timing", "brisk")
    assert calm.get("handover.belief") == brisk.get("handover.belief")


def test_an_unknown_timing_is_named_with_those_there_are(tmp_path):
    with pytest.raises(ConfigError, match="no timing 'hasty'; timings: calm, natural, brisk"):
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
