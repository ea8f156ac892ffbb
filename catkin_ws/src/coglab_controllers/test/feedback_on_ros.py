"""ROS interface of the feedback controllers of a running robot."""

from __future__ import annotations

import re
import unittest

import rospy
from coglab_msgs.msg import FeedbackGain, FeedbackState, FeedbackStatus, ReasonCode
from coglab_msgs.srv import (
    DescribeController,
    FeedbackBySignal,
    FeedbackSelect,
    LoadFeedback,
    ReloadGains,
    SetExecutionOrder,
    SetGains,
)
from robot_fixture import Robot, wait_until
from rosgraph_msgs.msg import Log


class FeedbackOnRos(unittest.TestCase):
    """Services, status, state and log. The derived class provides the robot."""

    robot: Robot
    feedback: list[FeedbackStatus]

    def test_5_feedback_services(self) -> None:
        name = "controller_manager/feedback/"
        wait_until(lambda: bool(self.feedback), "feedback/status")
        names = [c.name for c in self.feedback[-1].controllers]
        self.assertEqual(sorted(names), ["ee_admittance", "joint_limits"])
        self.assertEqual(self.feedback[-1].profile, "dmp")
        call = self.robot.call
        answer = call(name + "describe", DescribeController, "joint_limits")
        self.assertTrue(answer.success and "joint_position" in answer.text)
        self.assertFalse(call(name + "describe", DescribeController, "joint_limit").success)
        answer = call(name + "set_execution_order", SetExecutionOrder, names[:1])
        self.assertFalse(answer.success)
        answer = call(name + "set_execution_order", SetExecutionOrder, names[::-1])
        self.assertTrue(answer.success, answer.message)
        answer = call(name + "enable", FeedbackSelect, ["ee_admittance"], "")
        self.assertTrue(answer.success, answer.message)
        wait_until(
            lambda: next(c for c in self.feedback[-1].controllers if c.name == "ee_admittance").enabled, "enabled"
        )
        answer = call(name + "pause_by_signal", FeedbackBySignal, "wrench", False)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(list(answer.affected), ["ee_admittance"])
        answer = call(name + "resume_by_signal", FeedbackBySignal, "wrench", False)
        self.assertEqual(list(answer.affected), ["ee_admittance"])
        answer = call(name + "reload_gains", ReloadGains, "ee_admittance", "")
        self.assertTrue(answer.success, answer.message)
        answer = call(name + "reload_gains", ReloadGains, "ee_admittance", "/no/such.yaml")
        self.assertFalse(answer.success)
        self.assertTrue(call(name + "disable", FeedbackSelect, ["ee_admittance"], "").success)
        self.assertFalse(call(name + "enable", FeedbackSelect, ["nobody"], "").success)

    def test_5b_feedback_controllers_are_loaded_watched_and_unloaded(self) -> None:
        """A controller is loaded on a running robot, publishes its state and corrections, and is unloaded."""
        name = "controller_manager/feedback/"
        call, shown = self.robot.call, []
        rospy.Subscriber(name + "state", FeedbackState, shown.append)
        config = "package://ctrl_more/config/ee_admittance.yaml"
        for code, *refused in (
            (ReasonCode.BUSY, "dmp", "EeAdmittance", "", ""),
            (ReasonCode.BUSY, "joint_limits", "JointLimits", "", ""),
            (ReasonCode.BAD_FILE, "second", "NoSuchType", "", ""),
            (ReasonCode.BAD_FILE, "second", "EeAdmittance", "", "/no/such.yaml"),
        ):
            answer = call(name + "load", LoadFeedback, *refused)
            self.assertFalse(answer.success, refused)
            self.assertTrue(answer.message, refused)
            self.assertEqual(answer.reason_code, code, (refused, answer.message))
        answer = call(name + "load", LoadFeedback, "second", "EeAdmittance", "", config)
        self.assertTrue(answer.success, answer.message)
        gains = [FeedbackGain("force_dead_band", [0.0]), FeedbackGain("stiffness", [20.0])]
        answer = call(name + "set_gains", SetGains, "second", gains)
        self.assertTrue(answer.success, answer.message)
        self.assertFalse(call(name + "set_gains", SetGains, "second", [FeedbackGain("stifness", [1.0])]).success)
        self.assertFalse(call(name + "set_gains", SetGains, "second", [FeedbackGain("mass", [1.0, 2.0])]).success)
        self.assertTrue(call(name + "enable", FeedbackSelect, ["second"], "").success)

        def state() -> dict[str, float]:
            found = [s for s in shown[-1].states if s.controller == "second"] if shown else []
            return dict(zip(found[0].names, found[0].values, strict=True)) if found else {}

        wait_until(lambda: "offset_x" in state(), "state of the controller that was loaded")
        self.assertEqual(set(shown[-1].states[-1].units), {"m", "rad", "N"})
        wait_until(
            lambda: any(
                c.controller == "second"
                and c.signal == "taskSpaceReferencePose/ee"
                and len(c.before) == len(c.after) == 7
                for c in shown[-1].corrections
            ),
            "its correction of the pose",
        )
        self.say_on_rosout("second")
        self.assertIn("second", [c.name for c in self.feedback[-1].controllers])
        answer = call(name + "unload", FeedbackSelect, ["second"], "")
        self.assertFalse(answer.success)
        self.assertIn("disable", answer.message)
        self.assertEqual(answer.reason_code, ReasonCode.BUSY)
        self.assertTrue(call(name + "disable", FeedbackSelect, ["second"], "").success)
        wait_until(lambda: call(name + "unload", FeedbackSelect, ["second"], "").success, "unloaded")
        wait_until(lambda: "second" not in [c.name for c in self.feedback[-1].controllers], "gone")
        self.assertFalse(call(name + "unload", FeedbackSelect, [], "").success)
        self.assertFalse(call(name + "unload", FeedbackSelect, ["ee_admittance"], "").success, "part of a profile")

    def test_5c_a_request_outside_what_the_srv_file_says_is_refused_whole(self) -> None:
        """Each refusal contains the received and the expected value, and changes nothing."""
        name, call = "controller_manager/feedback/", self.robot.call
        odd = ("\x1b[2J", "a\0b", " ", "\N{RIGHT-TO-LEFT OVERRIDE}x", "x" * 201)
        requests = [
            (verb, ["ee_admittance"], text) for verb in ("enable", "disable", "pause", "resume") for text in odd
        ]
        requests += [("apply_profile", ["dmp"], text) for text in odd]
        # An empty name among others would otherwise be all of them.
        requests += [(verb, [""], "") for verb in ("enable", "disable", "pause", "resume")]
        requests += [("enable", ["ee_admittance", ""], ""), ("unload", ["second"], odd[0])]
        for verb, names, reason in requests:
            answer = call(name + verb, FeedbackSelect, names, reason)
            self.assertFalse(answer.success, (verb, names, reason[:9]))
            self.assertEqual(answer.reason_code, ReasonCode.INVALID_ARGUMENT, answer.message)
            self.assertRegex(answer.message, "expected", (verb, names))
            self.assertTrue(answer.message.isprintable(), repr(answer.message))
        self.assertTrue(call(name + "pause", FeedbackSelect, ["ee_admittance"], "lunch ☃").success)
        for names in (["ee_admittance"], []):
            answer = call(name + "resume", FeedbackSelect, names, "supper")
            self.assertFalse(answer.success, "no pause has this reason")
            self.assertEqual(answer.reason_code, ReasonCode.UNKNOWN_NAME, answer.message)
            self.assertIn("lunch ☃", answer.message)
        self.assertTrue(call(name + "resume", FeedbackSelect, ["ee_admittance"], "").success, "nothing to withdraw")
        # All of them: with the reason that was given.
        self.assertTrue(call(name + "resume", FeedbackSelect, [], "lunch ☃").success)
        wait_until(lambda: not any(c.paused for c in self.feedback[-1].controllers), "nothing paused")

    def say_on_rosout(self, controller: str) -> None:
        """A controller at a bound logs this with its name, source location, cycle and numbers."""
        told: list[Log] = []
        rospy.Subscriber("/rosout", Log, told.append)
        gains = [FeedbackGain("max_offset", [0.0])]
        answer = self.robot.call("controller_manager/feedback/set_gains", SetGains, controller, gains)
        self.assertTrue(answer.success, answer.message)

        place = rf"{controller} \(ee_admittance.cpp:[0-9]+, cycle [0-9]+\): "
        words = place + r"[^:]*[0-9.e-]+ N [^:]*max_offset"

        def own_words() -> list[Log]:
            return [line for line in told if re.search(words, line.msg)]

        wait_until(lambda: bool(own_words()), "what it logs on /rosout")
        self.assertEqual((own_words()[0].level, own_words()[0].name), (Log.WARN, "/robot"))
