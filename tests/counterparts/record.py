"""Makes the transcripts anew: `python -m tests.counterparts.record`.

python-gphoto2 is the host, the simulated camera the responder; needed when either says something
else on purpose. The PC's name and the host's random GUID are not kept.
"""

import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from labrig.foundation.clock import VirtualClock
from labrig.sim.camera import BodySettings
from labrig.sim.camera.ptpip import server as ptpip_server
from labrig.sim.camera.ptpip.packets import Packet, PacketType
from labrig.sim.camera.ptpip.server import Connection

from . import transcript
from .gphoto2_commands import MAX_S, READY, STANDARD_READY, TO_CARD, TO_HOST, command
from .served import EOS, EPOCH_S, STANDARD, Film, served
from .transcript import CAMERA, COMMAND, EVENT, HOST, Line

SESSIONS = {
    "connect": ("summary",),
    "configure": (*READY, "set:iso=1600", "set:aperture=11", "set:shutterspeed=1/125"),
    "capture_to_host": (*READY, TO_HOST, "capture"),
    "capture_to_card": (*READY, TO_CARD, "capture"),
    "bulb": ("set:iso=200", "set:aperture=8", "set:shutterspeed=bulb", TO_CARD, "bulb:0.5"),
    "standard_capture": (*STANDARD_READY, "capture"),
}
PICTURE_BYTES = 600


def body_of(name: str) -> BodySettings:
    """Which camera a session is with."""
    return STANDARD if name.startswith("standard_") else EOS


def _anonymous() -> bytes:
    return b"a host's own id!" + "host\0".encode("utf-16-le") + struct.pack("<I", 0x00010000)


@contextmanager
def recording(clock: VirtualClock) -> Iterator[list[Line]]:
    """Every packet that servers take or send meanwhile."""
    lines: list[Line] = []

    class Recorded(Connection):
        name = COMMAND

        def next_packet(self) -> Packet | None:
            packet = super().next_packet()
            if packet is not None:
                payload = packet.payload
                if packet.kind == PacketType.INIT_COMMAND_REQUEST:
                    payload = _anonymous()
                elif packet.kind == PacketType.INIT_EVENT_REQUEST:
                    self.name = EVENT
                whole = struct.pack("<II", 8 + len(payload), packet.kind) + payload
                lines.append(transcript.line(clock.now(), HOST, self.name, whole))
            return packet

        def put(self, packets: list[bytes]) -> None:
            lines.extend(transcript.line(clock.now(), CAMERA, self.name, p) for p in packets)
            super().put(packets)

    with patch.object(ptpip_server, "Connection", Recorded):
        yield lines


def record(name: str, steps: tuple[str, ...]) -> None:
    clock = VirtualClock(EPOCH_S)
    with recording(clock) as lines, tempfile.TemporaryDirectory() as home:
        with served(Film(size=PICTURE_BYTES), clock, body_of(name)) as server:
            environment = os.environ | {"HOME": home, "LANG": "C"}
            subprocess.run(command(server.port, *steps), env=environment, timeout=MAX_S, check=True)
        transcript.write(transcript.FOLDER / f"{name}.jsonl", lines)


if __name__ == "__main__":
    transcript.FOLDER.mkdir(exist_ok=True)
    for session in sys.argv[1:] or SESSIONS:
        record(session, SESSIONS[session])
