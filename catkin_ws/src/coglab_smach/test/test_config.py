"""machines.yaml and the table of parameters: valid files, and refusals with file, line and field."""

import os
from pathlib import Path

import pytest
from coglab_smach.context.config import Config, ConfigError
from coglab_smach.parameters import TABLE, markdown

SHIPPED = Path(__file__).resolve().parents[1] / "config" / "machines.yaml"
RANGED = [row for row in TABLE if row.low is not None]


def nested(name, value):
    """The value as a YAML text of one file."""
    text = str(value) if isinstance(value, int) else f"{value:.7f}"
    return "{" + ": {".join(name.split(".")) + f": {text}" + "}" * (name.count(".") + 1)


@pytest.fixture
def load(tmp_path):
    """Loads a text as a file."""

    def load(text, **overrides):
        path = tmp_path / "machines.yaml"
        path.write_text(text)
        return Config.load(str(path), overrides)

    return load


def test_the_shipped_file_and_every_default_fit(load):
    shipped = Config.load(str(SHIPPED))
    assert len(shipped.get("postures.home")) == 7 and shipped.get("timing") == "natural"
    for row in RANGED:
        if row.default is not None:
            assert load(nested(row.name, row.default)).get(row.name) == load("{}").get(row.name) == row.default
        assert f"| `{row.name}` |" in markdown()


@pytest.mark.parametrize("row", RANGED, ids=lambda row: row.name)
def test_values_beyond_a_range_are_refused(load, row):
    step = 1 if isinstance(row.default, int) else 1e-6
    for inside, outside in (
        (row.low + step * row.above, row.low - step * (not row.above)),
        (row.high, row.high + step),
    ):
        load(nested(row.name, inside))
        with pytest.raises(ConfigError, match=rf"machines.yaml:1: {row.name}: .*(minimum|maximum)"):
            load(nested(row.name, outside))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("auto_trigger: true\nhand: {opne_speed: 400}", ":2: hand.opne_speed: .*'hand.open_speed'"),
        ("hubs: {}", ":1: hubs: .*'hub'"),
        ("nonsense_of_mine: 1", "nonsense_of_mine: [^']*$"),
        ("hand: {calibration: slow}", "hand.calibration: 'slow'"),
        ("reach_timeout: .nan", "reach_timeout: "),
        ("postures: {home: [0, 0, 0, 0, 0, 0]}", "postures.home: "),
        ("time_limits: {wait_stop: -1}", "time_limits.wait_stop: -1"),
        ("handover: {region_low: [0.9, -0.5, 0.05], region_high: [0.8, 0.5, 0.8]}", "region_low"),
        ("timing: hasty\ntimings: {calm: {}}", "'hasty'.* calm"),
        ("timings: {calm: {handover.hand_margin: 0.3}}", "'handover.hand_margin'"),
        ("timings: {calm: {handover.doubt: -1.0}}", r"-1\.0"),
    ],
)
def test_invalid_values_are_named_with_file_line_and_field(load, text, said):
    with pytest.raises(ConfigError, match=said):
        load(text)


def test_parameters_of_the_node_win_and_are_checked_too():
    assert Config.load(str(SHIPPED), {"hand.open_speed": 100}).get("hand.open_speed") == 100
    with pytest.raises(ConfigError, match="hand.open_speed: 'fast'.*integer"):
        Config.load(str(SHIPPED), {"hand.open_speed": "fast"})
    with pytest.raises(ConfigError, match="'hasty'"):
        Config.load(str(SHIPPED), {"timing": "hasty"})


def test_parameter_wins_over_timing_and_timing_over_file():
    natural, calm = (Config.load(str(SHIPPED), {"timing": name}) for name in ("natural", "calm"))
    assert calm.get("handover.belief") < natural.get("handover.belief")
    assert calm.get("handover.doubt") == natural.get("handover.doubt")
    assert Config.load(str(SHIPPED), {"timing": "calm", "hand.lift_after": 2.0}).get("hand.lift_after") == 2.0
    calm.set("timing", "natural")
    assert calm.get("handover.belief") == natural.get("handover.belief")


def test_the_old_values_stay_if_the_changed_file_is_invalid(tmp_path):
    path, warnings = tmp_path / "machines.yaml", []
    path.write_text("hand: {open_speed: 100}\n")
    config = Config.load(str(path), warn=warnings.append)
    path.write_text("hand: {open_speed: 1000}\n")
    os.utime(path, ns=(5, 5))
    assert config.get("hand.open_speed") == 100
    assert len(warnings) == 1 and "hand.open_speed: 1000" in warnings[0]
    path.write_text("hand: {open_speed: 200}\n")
    os.utime(path, ns=(6, 6))
    assert config.get("hand.open_speed") == 200


def test_a_value_in_neither_file_nor_table_is_missing(load):
    for name in ("postures.home", "hand.nonsense"):
        with pytest.raises(ConfigError, match=f"'{name}'"):
            load("{}").get(name)
