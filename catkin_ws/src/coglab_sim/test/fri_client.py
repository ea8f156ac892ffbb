"""A minimal PC side of FRI for tests, with its own decoder.

The offsets are typed from the protocol tables, not taken from the C++ code, so that tests find a wrong field there.
"""

import struct

MEASUREMENT = {  # name: (offset, struct format)
    "header": (0, "<4H"),
    "reals": (8, "<16f"),
    "ints": (72, "<16i"),
    "bools": (136, "<H"),
    "timestamp": (140, "<f"),
    "state": (144, "<H"),
    "quality": (146, "<H"),
    "measurement_period": (148, "<f"),
    "command_period": (152, "<f"),
    "safety_scale": (156, "<f"),
    "answer_rate": (160, "<f"),
    "latency": (164, "<f"),
    "jitter": (168, "<f"),
    "miss_rate": (172, "<f"),
    "miss_counter": (176, "<I"),
    "power": (180, "<H"),
    "control": (182, "<H"),
    "error": (184, "<H"),
    "warning": (186, "<H"),
    "temperature": (188, "<7f"),
    "position": (216, "<7f"),
    "frame": (244, "<12f"),
    "commanded": (292, "<7f"),
    "offset": (320, "<7f"),
    "commanded_frame": (348, "<12f"),
    "frame_offset": (396, "<12f"),
    "torque": (444, "<7f"),
    "external_torque": (472, "<7f"),
    "wrench": (500, "<6f"),
    "jacobian": (524, "<42f"),
    "mass": (692, "<49f"),
    "gravity": (888, "<7f"),
}
JOINT_POSITION, JOINT_IMPEDANCE, CARTESIAN_IMPEDANCE = 0x0001, 0x0035, 0x3500
MONITOR, COMMAND = 1, 2


def parse(data: bytes) -> dict:
    """All fields of a measurement; scalars as numbers, arrays as tuples."""
    assert len(data) == 916
    fields = {}
    for name, (offset, layout) in MEASUREMENT.items():
        values = struct.unpack_from(layout, data, offset)
        fields[name] = values if len(values) > 1 else values[0]
    return fields


class Client:
    """Answers measurements; mirrors the set-point until `move` is given."""

    def __init__(self, flags: int = JOINT_POSITION) -> None:
        self.counter = 0
        self.flags = flags
        self.reals = [0.0] * 16
        self.ints = [0] * 16
        self.bools = 0
        self.torque = [0.0] * 7
        self.stiffness = [1000.0] * 7
        self.damping = [0.7] * 7
        self.frame = None
        self.cart_stiffness = [2000.0] * 3 + [200.0] * 3
        self.position = None

    def answer(self, measurement: bytes, position=None, **overrides) -> bytes:
        """The command that answers `measurement`; `position` (7 rad) instead of the mirrored set-point."""
        fields = parse(measurement)
        set_point = [a + b for a, b in zip(fields["commanded"], fields["offset"], strict=True)]
        self.counter = (self.counter + 1) & 0xFFFF
        data = bytearray(376)
        header = overrides.get("header", (self.counter, fields["header"][0], 376, 0x1005))
        struct.pack_into("<4H", data, 0, *header)
        struct.pack_into("<16f", data, 8, *self.reals)
        struct.pack_into("<16i", data, 72, *self.ints)
        struct.pack_into("<H", data, 136, self.bools)
        struct.pack_into("<I", data, 140, overrides.get("flags", self.flags))
        struct.pack_into("<7f", data, 144, *(set_point if position is None else position))
        struct.pack_into("<12f", data, 172, *(fields["commanded_frame"] if self.frame is None else self.frame))
        struct.pack_into("<7f", data, 220, *self.torque)
        struct.pack_into("<7f", data, 272, *self.stiffness)
        struct.pack_into("<7f", data, 300, *self.damping)
        struct.pack_into("<6f", data, 328, *self.cart_stiffness)
        struct.pack_into("<6f", data, 352, *([0.7] * 6))
        return bytes(data)

    def request(self, kind: int, strategy: int = 10) -> None:
        """Our own KRL program: 1 start, 2 stop."""
        self.ints[0], self.ints[1], self.ints[2] = kind, strategy, self.ints[2] + 1


class Session:
    """A cell and a client in lockstep."""

    def __init__(self, urdf: str, client: Client | None = None, **parameters) -> None:
        from coglab_sim import _cell

        self.cell = _cell.Cell(urdf, {key.replace("__", "/"): value for key, value in parameters.items()})
        self.client = client or Client()
        self.measurement = None
        self.sent = 0

    def tick(self, position=None, answer: bool = True, **overrides) -> dict | None:
        """One FRI period; None if the controller sent nothing."""
        data = None
        if answer and self.measurement is not None:
            data = self.client.answer(self.measurement, position, **overrides)
        out = self.cell.step(data)
        self.sent += out is not None
        self.measurement = out
        return parse(out) if out is not None else None

    def run(self, seconds: float, **kwargs) -> dict | None:
        """Runs for this simulated time (s)."""
        fields = None
        for _ in range(max(1, round(seconds / self.cell.period))):
            fields = self.tick(**kwargs)
        return fields

    def monitor(self) -> dict:
        """Until the quality is perfect and the drives are on."""
        fields = self.run(max(2.0, 110 * self.cell.period))
        assert (fields["state"], fields["quality"], fields["power"]) == (MONITOR, 3, 0x7F), self.cell.messages
        return fields

    def command(self, strategy: int = 10) -> dict:
        """Into command mode by our own KRL program."""
        self.monitor()
        self.client.flags = {10: JOINT_POSITION, 20: CARTESIAN_IMPEDANCE, 30: JOINT_IMPEDANCE}[strategy]
        self.client.request(1, strategy)
        fields = self.run(1.0)
        assert fields["state"] == COMMAND, self.cell.messages
        assert fields["control"] == strategy // 10
        return fields

    def texts(self) -> list[str]:
        """The controller's message window."""
        return [text for _, text in self.cell.messages]


def set_point(fields: dict) -> list[float]:
    """Commanded total of a measurement."""
    return [a + b for a, b in zip(fields["commanded"], fields["offset"], strict=True)]
