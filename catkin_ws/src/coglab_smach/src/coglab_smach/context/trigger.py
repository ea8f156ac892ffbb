"""A trigger from outside, judged before a hub gets it."""

from __future__ import annotations

from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.context.requests import Answer, command
from coglab_smach.ports.pending import PortError

DATABASE_WAIT = 2.0  # s that a trigger waits for the object database


def ask_for(ctx: Context, action: str, object_id: str = "", source: str = "operator") -> Answer:
    """A trigger from outside: refused at once where no hub takes it, or where the database has no such object. Waits
    for the database for 2 s at most."""
    refusal = ctx.requests.refusal(action, object_id)
    if refusal is not None:
        return refusal
    default = ctx.requests.default_object
    wanted = object_id or default
    if default is not None and wanted:
        try:
            known = _objects(ctx)
        except PortError as error:
            again = f"when the database answers, {command(action)} {wanted}"
            return Answer(False, f"'{action}' refused: {error.sentence}; {again}", error.code)
        if wanted not in known:
            return Answer(
                False,
                f"'{action}' refused: object '{wanted}' is not in the database; it has: "
                f"{', '.join(known)}; {command(action)} {known[0] if known else 'OBJECT'}",
                ReasonCode.OBJECT_UNKNOWN,
            )
    return ctx.requests.submit(action, object_id, source)


def _objects(ctx: Context) -> list[str]:
    pending = ctx.database.list_objects()
    end = ctx.clock.now() + DATABASE_WAIT
    while not pending.done():
        if ctx.clock.now() >= end:
            pending.cancel()
            raise PortError(
                f"the object database has not answered within {DATABASE_WAIT:.0f} s",
                code=ReasonCode.NODE_SILENT,
            )
        ctx.clock.sleep(0.01)
    return sorted(pending.result())
