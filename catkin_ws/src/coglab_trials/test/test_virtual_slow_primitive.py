"""A primitive that an object's file slows down to the most it may ask for, on the real controllers: the reach is
waited for."""

import smach
from coglab_trials.trial import VirtualTrial


def test_a_reach_of_ten_times_its_duration_is_waited_for():
    smach.set_loggers(*[lambda *a: None] * 4)
    trial = VirtualTrial(seed=3, object_on="world", profile="accustomed", perfect=True)
    database = trial.ctx.database
    ask = database.get_object

    def get_object(object_id):
        answer = ask(object_id)
        answer.result()["dmp"]["dmp_ratio"] = 10.0
        return answer

    database.get_object = get_object
    result = trial.run("take", limit=120.0)[0]
    assert result.outcome == "succeeded", trial.ctx.journal.why()
    assert trial.rig.robot.limit_violations == 0
    # The demonstration of `take_board` took 1.8 s; what a reach was given before was 8 s.
    assert result.ended - result.started > 15.0
