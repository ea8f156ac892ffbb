"""Valid and invalid values of a user's motion in coglab.control."""

import numpy as np
import pytest
from coglab.control import ControlError, Motion, MotionSetup, Reference
from coglab.control.simulation import simulate


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"joints": np.zeros(6)}, r"joints: .*\(7,\).*\(6,\)"),
        ({"joints": [0.0] * 6 + [np.nan]}, r"joints\[6\].* nan"),
        ({"joints": np.zeros(7) + 1j}, "7 numbers"),
        ({"joints": ["a"] * 7}, "7 numbers"),
        ({"joint_velocity": np.zeros(7)}, "without joints"),
        ({"joints": np.zeros(7), "twist": np.zeros(6)}, "both came"),
        ({"position": np.zeros(3)}, "position and orientation"),
        ({"position": np.zeros(3), "orientation": [0, 0, 0, 2]}, " 2"),
    ],
)
def test_an_invalid_reference_is_refused_with_a_reason(fields, words):
    with pytest.raises(ControlError, match=words):
        Reference(**fields)


def test_reference_keeps_a_copy():
    joints = np.zeros(7)
    reference = Reference(joints=joints)
    joints[0] = 1.0
    assert reference.joints is not None and reference.joints[0] == 0.0


def test_arguments_have_defaults_and_ranges():
    setup = MotionSetup()
    name = setup.argument("radius", "m", 0.05, 0.0, 0.15)
    assert setup.values({}) == {name: 0.05}
    for wrong in (0.2, float("nan"), "wide"):
        with pytest.raises(ControlError, match=r"0\.0 to 0\.15 m"):
            setup.values({"radius": wrong})
    with pytest.raises(ControlError, match="'size'.*radius"):
        setup.values({"size": 1.0})


def test_done_must_return_a_truth_value():
    class Talks(Motion):
        def start(self, start):
            self.at = start.set_point.joints

        def reference(self, cycle):
            return Reference(joints=self.at)

        def done(self):
            return "not yet"

    with pytest.raises(ControlError, match="'not yet'"):
        simulate(Talks())
