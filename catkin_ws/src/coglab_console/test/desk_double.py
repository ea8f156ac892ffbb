"""A desk with a double of the robot, and the actions of a browser."""

import asyncio
import json
import time
from unittest import mock

from coglab_console.desk import desk as module
from coglab_console.desk.desk import Desk
from coglab_console.desk.events import EventLog
from coglab_console.desk.motion_guard import HeldButton
from coglab_console.web.fan_out import Documents
from console_double import RobotDouble

RECEIVE = {"action": "exchange_human_to_robot"}


class Clock:
    """A clock that only a test advances."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


def desk_in(folder, now=time.time):
    """A desk that writes its sessions to this folder."""
    return Desk(RobotDouble(), EventLog(now), Documents(), folder, now, lambda: "http://link")


def ask(desk, who, command, /, **arguments):
    return asyncio.run(desk.command(who, command, arguments))


def shown(desk):
    """The document `desk` of the page."""
    desk.tick()
    documents = [json.loads(text) for text in desk.documents.newer({})]
    return next(one["value"] for one in documents if one["name"] == "desk")


def newest(desk):
    """Number of the newest stop."""
    return shown(desk)["guard"]["stop"]


def buttons_follow(clock):
    """A context in which the held buttons of a desk measure time with this clock."""
    return mock.patch.object(module, "HeldButton", lambda: HeldButton(clock))


def hold_for(desk, seconds, gap=0.1, who="a", what=("start", RECEIVE)):
    clock = Clock()

    async def press():
        answers = []
        for _ in range(round(seconds / gap)):
            answers.append(await desk.held(who, *what))
            clock.time += gap
        return [answer for answer in answers if answer is not None]

    with buttons_follow(clock):
        return asyncio.run(press())
