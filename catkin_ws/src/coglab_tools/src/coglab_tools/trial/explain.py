"""The events of a trial, in at most ten lines with times."""

from __future__ import annotations

from coglab.results import ACTIONS, reason_name

from coglab_tools.report.metrics import metrics_of
from coglab_tools.trial.read import Measured

LINES = 10
WRONG = ("failed", "failed_empty", "failed_holding", "aborted", "fault", "stopped", "time_out", "timeout", "lost")
"""outcomes of states that no success contains"""
MARKS = {
    "offered": "the offer was believed",
    "requested": "the request was believed",
    "motion_started": "the arm began to move",
    "motion_reached": "the arm reached its goal",
    "preshaped": "the hand was preshaped",
    "paused": "the arm paused",
    "contact": "contact was found",
    "closing": "the hand began to close",
    "closing_on_the_way": "the hand began to close on the way",
    "closed": "the hand was closed",
    "loaded": "the load came",
    "opening": "the hand began to open",
    "released": "the object was let go",
    "placed": "the object was placed",
    "tightened": "the grip was tightened",
    "switch_dmp": "the primitive was changed",
}
"""text of marks; others are shown by their names"""
LESS = ("preshaped", "paused", "closing", "closing_on_the_way", "tightened")  # marks that are left out first


def headline(trial: Measured) -> str:
    """The outcome in one sentence."""
    record, outcome = trial.record, trial.record.outcome
    what = record.action.replace("_", " ").replace("+", ", then ") + (f" of {record.object}" if record.object else "")
    if outcome.success:
        return f"{what}: succeeded in {record.duration_s:.2f} s"
    reason = f"{outcome.reason} ({outcome.code})" if outcome.code else "no success"
    return f"{what}: {reason} after {record.duration_s:.2f} s: {outcome.text or 'no reason was given'}"


def first_failure(trial: Measured) -> tuple[float, str] | None:
    """The first failed transition: s after the start, and a sentence; None without one."""
    for t, path, state, outcome, _, reason, code in trial.series.transitions:
        if trial.start - 0.05 <= t <= trial.end + 1.0 and outcome in WRONG and code:
            where = path.rpartition("/")[2].replace("_", " ")
            words = f"first went wrong: {state} in {where} {outcome}, {reason_name(code)} ({code}): {reason}"
            return t - trial.start, words
    return None


def events(trial: Measured) -> list[tuple[float, str, bool]]:
    """Events by time: (s after the start, sentence, True if it can be left out)."""
    words = MARKS | ({"offered": MARKS["requested"]} if trial.record.action == ACTIONS["give"] else {})
    found = [(mark["time_s"], words.get(mark["name"], mark["name"].replace("_", " ")), mark["name"] in LESS)
             for mark in trial.record.marks]  # fmt: skip
    inside = (trial.start, trial.end + 1.0)
    found += [
        (t - trial.start, f'the robot said "{_said(text)}"', True)
        for t, text in trial.said
        if inside[0] <= t <= inside[1]
    ]
    for t, contact, margin, text in trial.series.contacts:
        if inside[0] <= t <= inside[1]:
            times = f", {margin:.1f} times its threshold" if margin > 1.0 else ""
            found.append((t - trial.start, f"detector: {text}{times}" if contact else f"detector: {text}", False))
    return sorted(found)


def _said(text: str) -> str:
    """A sentence, or the name of one in virtual time, such as YOU_HAVE_IT."""
    return text.replace("_", " ").lower() if text.isupper() else text


def explain(trial: Measured) -> list[str]:
    """At most ten lines for each action: outcome, first failure and its reason, and events (s after its
    start)."""
    lines = [line for part in trial.parts() for line in _explain(part)]
    return [*lines, f"notes: {trial.record.notes}"] if trial.record.notes and len(trial.exchanges) > 1 else lines


def _explain(trial: Measured) -> list[str]:
    lines = [headline(trial)]
    if not trial.record.outcome.success:
        if wrong := first_failure(trial):
            lines.append(f"{wrong[0]:+7.2f} s  {wrong[1]}")
        causes = [cause for exchange in trial.exchanges for cause in exchange.causes]
        if causes:
            lines.append(" " * 11 + "because " + ", because ".join(causes))
    tail = []
    found = metrics_of(trial)
    words = [
        f"{text} {found[name]:.3g} {unit}"
        for name, text, unit in (
            ("peak_force_n", "peak force", "N"),
            ("detection_delay_s", "detection delay", "s"),
            ("nearest_m", "hands at least", "m apart"),
        )
        if found[name] is not None
    ]
    if words:
        tail.append("measured: " + ", ".join(words))
    if trial.record.notes:
        tail.append(f"notes: {trial.record.notes}")
    all_events, room = events(trial), LINES - len(lines) - len(tail)
    if len(all_events) > room:
        all_events = [event for event in all_events if not event[2]]
    if len(all_events) > room:
        left_out = len(all_events) - room + 1
        half = (room - 1) // 2
        kept = all_events[: room - 1 - half], all_events[len(all_events) - half :]
        lines += [f"{t:+7.2f} s  {text}" for t, text, _ in kept[0]]
        lines.append(f"           ({left_out} more events: ./coglab trial show)")
        lines += [f"{t:+7.2f} s  {text}" for t, text, _ in kept[1]]
    else:
        lines += [f"{t:+7.2f} s  {text}" for t, text, _ in all_events]
    return lines + tail
