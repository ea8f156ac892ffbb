"""What changes seldom of the robot: the document `status` of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..desk.words import phase, plain, supervisor

if TYPE_CHECKING:
    from .view import RosView

ALL_DRIVES = 0x7F  # one bit a joint; further bits of the word say something else


def document(view: RosView) -> dict:
    """From the newest messages."""
    now, machine, arm, hand = view.standing(), view.machine, view.arm, view.hand
    return {
        "machine": {
            "alive": view.there("coglab/state"),
            "state": machine.state,
            "words": phase(machine.state),
            "hub": machine.in_hub,
            "actions": list(machine.actions),
            "object": machine.object_id,
            "why": plain(machine.why),
            "fallback": str(view.config().get("default_object", "")),
        },
        "arm": {
            "alive": view.there("lwr/state"),
            "supervisor": arm.supervisor,
            "words": supervisor(arm.supervisor),
            "fri": arm.fri_state,
            "quality": arm.quality,
            "mode": arm.control_mode,
            "power": arm.power & ALL_DRIVES == ALL_DRIVES,
            "allowed": arm.motion_allowed,
            "held": arm.hold_latched,
            "reason": plain(arm.reason),
            "cycle": arm.cycle_time,
        },
        "hand": {
            "alive": view.there("ih2_hand/hand_status"),
            "connected": hand.connected,
            "calibrated": hand.calibrated,
            "calibrating": hand.calibrating,
            "holding": hand.holding,
            "message": hand.message,
            "motors": len(hand.motors),
        },
        "manager": {
            "alive": view.there("controller_manager/status"),
            "state": view.manager.state,
            "active": view.manager.active_controller,
            "reason": plain(view.manager.reason),
            "scale": round(view.manager.speed_scale, 3),
        },
        "contact": {
            "words": view.contact,
            "stamp": round(view.contact_stamp, 1),
            "alive": now.detector_alive,
            "state": view.signal.state,
            "mode": view.signal.mode,
            "learnt": view.signal.learnt,
            "samples": view.signal.rest_samples,
            "k": round(view.signal.k, 3),
            "window": round(view.signal.window, 4),
        },
    }
