"""Measures of one handover of a study, by the names and definitions of coglab_tools.report.metrics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from coglab import Exchange, Trial

DIGITS = 6  # of a time in the table


def measures_of(trial: Trial, exchange: Exchange) -> dict[str, float]:
    """Measures of one handover of a trial in virtual time; those that do not apply are left out."""
    from coglab.results import ACTIONS

    from coglab_tools.report.metrics import metrics_of
    from coglab_tools.trial.read import Measured
    from coglab_tools.trial.record import Outcome, TrialRecord

    force = np.linalg.norm(trial.person_force, axis=1)
    record = TrialRecord("", "", exchange.duration, ACTIONS[exchange.what], Outcome(exchange.ok))
    measured = Measured(
        record,
        exchange.started,
        exchange.ended,
        trial.series(),
        (exchange,),
        person_force=list(zip(trial.time.tolist(), force.tolist(), strict=True)),
        true_hands=True,
    )
    return {name: value for name, value in metrics_of(measured).items() if value is not None}


def times_of(exchange: Exchange) -> dict[str, float]:
    """The measures that need no recording: duration, approach and transfer, s."""
    from coglab_tools.report.metrics import spans_of

    return {
        name: round(value, DIGITS)
        for name, value in {"duration_s": exchange.duration, **spans_of(exchange.marks)}.items()
    }
