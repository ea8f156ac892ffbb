"""Bridge and controller stand-in in lockstep, bytes in between; for tests and benches of both ends."""

from pathlib import Path

import lwr_fri_bridge as bridge_module
import numpy as np

SOURCES = Path(__file__).resolve().parents[2]
URDF = str(SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf")
LIMITS = str(SOURCES / "lwr_description" / "config" / "joint_limits.yaml")
MODES = {"position": 1, "cartesian_impedance": 2, "joint_impedance": 3}


class Wire:
    """Bridge and cell, one FRI period per tick()."""

    def __init__(self, bridge=None, profile="default", **parameters) -> None:
        from coglab_sim import _cell

        parameters = {key.replace("__", "/"): value for key, value in parameters.items()}
        self.cell = _cell.Cell(URDF, parameters)
        self.bridge = bridge_module.Bridge(LIMITS, profile, **(bridge or {}))
        self.measurement = None
        self.now = 0
        self.velocity = None
        self.commands = []

    def tick(self) -> None:
        answer = None
        if self.measurement is not None:
            answer = self.bridge.answer(self.measurement, self.now)
        else:
            self.bridge.idle(self.now)
        if self.velocity is not None:
            self.bridge.send_velocity(self.velocity, self.now)
        if answer is not None:
            self.commands.append(np.frombuffer(answer, np.float32, 7, 144).astype(float))
            del self.commands[:-4]
        self.measurement = self.cell.step(answer)
        self.now += round(self.cell.period * 1e9)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.cell.period)):
            self.tick()

    def request(self, event: str, limit: float = 15.0) -> tuple[bool, str]:
        """Submits an event and waits, in simulated time."""
        ticket = self.bridge.submit(event)
        for _ in range(round(limit / self.cell.period)):
            self.tick()
            outcome = self.bridge.outcome(ticket)
            if outcome is not None:
                return outcome
        raise AssertionError(f"{event}: no outcome within {limit} s")

    def start(self, mode: str = "position") -> None:
        self.run(max(1.5, 110 * self.cell.period))
        for event in (mode, "start"):
            good, message = self.request(event)
            assert good, (message, self.cell.messages)


# Modes in which the arm is blocked for 5 s and released; the last two are soft, with a longer leash.
BLOCKED_MODES = (
    "position",
    "joint_impedance",
    "joint_impedance stiffness 200 damping 0.7",
    "cartesian_impedance",
    "joint_impedance stiffness 25",
    "cartesian_impedance stiffness 200 30",
)


BLOCKED_MOTIONS = {"A1 A2": [0.4, 0.2, 0, 0, 0, 0, 0], "with the wrist": [0.4, 0.2, 0, 0, 0, 0.3, 0]}  # rad/s


def speed_after_block(wire: Wire, mode: str, moving: str) -> float:
    """Largest joint speed (rad/s) in 3 s after somebody held the moving arm for 5 s."""
    wire.start(mode)
    wire.velocity = np.array(BLOCKED_MOTIONS[moving], dtype=float)
    wire.run(0.6)
    wire.cell.block(True)
    wire.run(5.0)
    wire.cell.block(False)
    peak = 0.0
    for _ in range(round(3.0 / wire.cell.period)):
        wire.tick()
        peak = max(peak, np.abs(wire.cell.velocity).max())
    return float(peak)


def lockstep_bytes(seed: int, periods: int) -> list[bytes | None]:
    """The controller's datagrams of a joint impedance motion with losses, from a seed."""
    wire = Wire(krc__period=0.002, seed=seed)
    wire.start("joint_impedance")
    out = []
    for tick in range(periods):
        wire.velocity = 0.4 * np.sin(tick * 0.002 * np.arange(1, 8))
        if tick == periods // 3:
            wire.cell.set_loss(0.01, 0.01)
        wire.tick()
        out.append(wire.measurement)
    return out
