"""What happened in a handover, in a few lines with times."""

from __future__ import annotations

from coglab.results import ACTIONS

from coglab_tools.trial.record import TrialRecord

MARKS = {
    "offered": "the person offered the object",
    "requested": "the person asked for the object",
    "preshaped": "the fingers stood ready",
    "motion_started": "the arm began its reach",
    "motion_reached": "the arm was at its goal",
    "paused": "the arm waited",
    "went_on": "the arm went on",
    "switch_dmp": "the arm changed to another motion",
    "contact": "contact was felt",
    "closing": "the fingers began to close",
    "closing_on_the_way": "the fingers began to close on the way",
    "closed": "the fingers had closed",
    "missed": "the fingers had closed on nothing",
    "loaded": "the arm carried the weight",
    "released": "the object changed hands",
    "opening": "the fingers began to open",
    "tightened": "the fingers held firmly",
    "gave_way": "the palm gave way to a pull",
}
"""event -> what it means"""
MINOR = ("preshaped", "closing_on_the_way", "tightened", "switch_dmp", "went_on", "paused")
"""left out first where there are too many"""
MOST = 10  # lines


def explain(record: TrialRecord) -> list[str]:
    """At most ten lines: what was asked, what happened when, and why it ended."""
    short = {long: name for name, long in ACTIONS.items()}.get(record.action, record.action)
    what = f"{short} {record.object}".strip()
    about = ", ".join(
        f"{name} {value}"
        for name, value in (("participant", record.participant), ("condition", record.condition))
        if value
    )
    ended = "succeeded" if record.success else f"ended as {record.outcome}"
    first = f"{record.started[11:19]} UTC: {what} {ended} after {record.duration_s:.1f} s" + (
        f" ({about})" if about else ""
    )
    end: list[str] = []
    if not record.success:
        because = "".join(f", because {cause}" for cause in record.causes[:2])
        end = [f"why: {record.text or record.outcome}{because} ({record.reason}, {record.code})"]
    room = MOST - 1 - len(end)
    times: dict[str, float] = {}
    for mark in record.marks:
        times.setdefault(str(mark["name"]), float(mark["time_s"]))
    for name in MINOR:
        if len(times) > room:
            times.pop(name, None)
    events = [f"{t:6.2f} s  {MARKS.get(name, name.replace('_', ' '))}" for name, t in times.items()]
    if len(events) > room:
        events = [*events[: room - 1], f"          ... {len(events) - room + 1} more: ./coglab trial show {record.id}"]
    return [first, *events, *end]
