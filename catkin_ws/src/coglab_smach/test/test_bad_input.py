"""Bad input, one case per line of the table in the README: what is wrong, where the machine ends, the sentence.

CASES are sentences that the brain itself makes. What a node says is only passed on here (PASSED_ON, in words that no
node has); its own words are asked of the node: coglab_controllers/test/test_limits_combined.cpp (a joint at its stop),
test_virtual_bad_input.py (a goal that is lost, a primitive that does not exist), coglab_sim/test/test_vision.py (two
people, an object that is not seen).
"""

import shutil

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_py.pose import Pose
from coglab_smach.ports.pending import PortError
from conftest import Trial

EXCHANGE = "exchange_human_to_robot"


def missing_object(t):
    t.wanted = "elephant"


def unreachable_object(t):
    t.ctx.reachable = lambda palm: False


def object_out_of_reach(t):
    t.cell.objects["mug"] = Pose([1.4, 0.2, 0.1])


def hand_dead(t):
    t.cell.faults.dead.add("hand")


CASES = {
    missing_object: "object 'elephant' is not in the database; it has: ball, bottle, mug, screwdriver, tea_box",
    unreachable_object: "'mug' cannot be reached: the arm has no posture for the hand at (0.78, -0.01, 0.50) m",
    object_out_of_reach: "'mug' was not offered within 8 s: it stayed at (1.40, 0.20, 0.10) m, outside the handover",
    hand_dead: "preshape 'cylindrical' within 6.0 s expected",
}


@pytest.mark.parametrize("prepare", CASES, ids=lambda f: f.__name__)
def test_bad_input_ends_in_the_hub_with_its_sentence(prepare):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.wanted = "mug"
        prepare(t)
        t.start(EXCHANGE, t.wanted)
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.result().outcome == "failed_empty"
    assert CASES[prepare] in trial.ctx.journal.why()
    # The same sentence on the topic (transitions) and in the result file.
    assert any(
        CASES[prepare].split(", because")[0] in r.reason
        for r in trial.ctx.journal.transitions
        if r.path == "/coglab_master" and r.from_state == EXCHANGE
    )
    assert CASES[prepare].split(", because")[0] in trial.result().to_dict()["reason"]
    assert list(trial.cell.joints) == trial.ctx.config.get("postures.home")


WORDS = "the words of a node that this test has made up 4711"


def joint_at_its_stop(t):
    t.cell.faults.abort_dmp_after, t.cell.faults.abort_reason = 0.05, WORDS


def goal_lost(t):
    t.cell.faults.abort_dmp_after, t.cell.faults.abort_reason = 0.6, WORDS


def two_people(t):
    t.cell.faults.refuse["locate mug"] = PortError(WORDS, code=ReasonCode.NOT_PERCEIVED)


def not_seen(t):
    t.cell.faults.refuse["locate mug"] = PortError(WORDS, code=ReasonCode.OBJECT_NOT_SEEN)


def missing_primitive(t):
    t.cell.faults.refuse["execute_dmp"] = PortError(WORDS, code=ReasonCode.UNKNOWN_NAME)


def database_refuses(t):
    t.cell.faults.refuse["get mug"] = PortError(WORDS, code=ReasonCode.OBJECT_UNKNOWN)


def hand_refuses(t):
    t.cell.faults.refuse["preshape cylindrical"] = PortError(WORDS, code=ReasonCode.HAND_STALLED)


PASSED_ON = {
    joint_at_its_stop: ("the reach was aborted, because ", ReasonCode.GOAL_LOST),
    goal_lost: ("the reach was aborted, because ", ReasonCode.GOAL_LOST),
    two_people: ("", ReasonCode.NOT_PERCEIVED),
    not_seen: ("", ReasonCode.OBJECT_NOT_SEEN),
    missing_primitive: ("", ReasonCode.UNKNOWN_NAME),
    database_refuses: ("", ReasonCode.OBJECT_UNKNOWN),
    hand_refuses: ("", ReasonCode.HAND_STALLED),
}


@pytest.mark.parametrize("prepare", PASSED_ON, ids=lambda f: f.__name__)
def test_what_a_node_says_reaches_the_person_word_for_word_with_its_code(prepare):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        prepare(t)
        t.start(EXCHANGE)
        t.wait_hub("wait_without_object")

    trial.run(script)
    result = trial.result()
    frame, code = PASSED_ON[prepare]
    assert result.outcome == "failed_empty" and result.code == code
    assert frame + WORDS in trial.ctx.journal.why(), trial.ctx.journal.why()
    assert WORDS in " ".join([result.reason, *result.causes])
    assert list(trial.cell.joints) == trial.ctx.config.get("postures.home")


@pytest.mark.parametrize(
    "moment, hub, sentence, code",
    [
        (0.3, "wait_without_object", "hand_preshape: preshape 'cylindrical' within 6.0 s", ReasonCode.TIME_LIMIT),
        (2.6, "stopped", "hand_close: closing of the hand within 11.9 s", ReasonCode.NOT_RELEASED),
    ],
)
def test_hand_node_dies_during_the_exchange(moment, hub, sentence, code):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.start(EXCHANGE)
        t.clock.sleep(moment)
        t.cell.faults.dead.add("hand")
        t.wait_hub(hub)

    trial.run(script)
    result = trial.result()
    assert (result.outcome, result.code) == ("failed_empty" if hub == "wait_without_object" else "stopped", code)
    assert [result.reason, *result.causes][-1] == f"{sentence} expected, it did not happen"
    assert "open" not in [c for c in trial.cell.called() if c == "open"][1:]


@pytest.mark.parametrize("action", [EXCHANGE, "take"])
def test_a_hand_node_that_dies_once_the_fingers_have_closed_has_not_said_that_they_closed_on_nothing(action):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        # Until it dies the hand says that it holds nothing, so that the brain gives it time to say otherwise.
        t.cell.faults.empty_grasp = True
        t.start(action)
        t.until(lambda: t.ctx.journal.marked("closed"))
        t.cell.calls.clear()
        t.clock.sleep(0.1)
        t.cell.faults.dead.add("hand")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.ctx.holding == "mug" and "missed" not in trial.result().marks
    assert not trial.cell.called("open") and not trial.cell.called("preshape"), "what it may hold would fall"


def stale(frame, age):
    """As execute_dmp refuses; what it means is in the code alone, the words may be any."""
    return PortError(f"frame '{frame}': age {age:.2f}, too much", code=ReasonCode.GOAL_STALE)


def test_a_goal_that_is_lost_for_a_moment_at_the_start_is_waited_for():
    trial = Trial()
    trial.cell.faults.refuse["execute_dmp"] = stale("object_mug", 0.45)

    def script(t):
        t.wait_hub("wait_without_object")
        t.start(EXCHANGE)
        while not t.cell.called("execute_dmp"):
            t.clock.sleep(0.02)
        t.clock.sleep(0.4)
        del t.cell.faults.refuse["execute_dmp"]
        t.wait_hub("wait_with_object")
        t.cell.faults.refuse["execute_dmp"] = stale("human_hand", 3.10)
        t.start("exchange_robot_to_human")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert [r.outcome for r in trial.ctx.journal.results[1:]] == ["succeeded", "failed_holding"]
    assert "age 3.10" in trial.ctx.journal.why()


def test_arm_node_dead_ends_in_fault_with_its_sentence():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.start(EXCHANGE)
        t.clock.sleep(1.0)
        t.cell.faults.dead.add("arm")
        t.wait_hub("fault")

    trial.run(script)
    why = trial.ctx.journal.why()
    assert why.startswith("wait_stop: ") and "the motion could not be ended: the robot is silent" in why
    assert trial.result().outcome == "fault"


def test_a_database_file_that_breaks_during_a_trial_keeps_the_old_entry(tmp_path):
    shutil.copytree(objects_folder(), tmp_path / "objects")
    trial = Trial()
    problems = []

    def script(t):
        t.database = t.ctx.database.database = ObjectDatabase(str(tmp_path / "objects"))
        assert t.database.reload() == []
        t.wait_hub("wait_without_object")
        t.start(EXCHANGE)
        file = tmp_path / "objects" / "mug.yaml"
        file.write_text(file.read_text().replace("mass: 0.31", "mass: heavy"))
        problems.extend(t.database.reload())
        t.wait_hub("wait_with_object")
        assert t.result().outcome == "succeeded"
        t.start("exchange_robot_to_human")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.result().outcome == "succeeded"
    assert len(problems) == 1 and "mug.yaml" in problems[0] and "mass" in problems[0], problems
    assert trial.database.get("mug")["mass"] == 0.31


def test_trigger_in_the_wrong_hub():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        ok, message, _ = t.ctx.requests.submit("put", "mug")
        assert not ok and message == (
            "'put' refused: wait_without_object takes exchange_human_to_robot, take; type: "
            "./coglab start exchange_human_to_robot or ./coglab start take"
        )
        t.clock.sleep(1.0)
        assert t.ctx.requests.hub() == "wait_without_object"

    trial.run(script)
