"""The guard: a separate process that switches the lights off when this one no longer can.

It receives once a second whether a light may be on. If this process ends without a report that all
lights are off (kill -9, out of memory, a crash of a library), or reports nothing for
`HANG_TIMEOUT_S` (stopped by a signal, hung in a call), the guard opens the lights' ports by the
same drivers and switches them off, after having killed a process that hangs. Its code is in
`guard_process`.
"""

import json
import os
import subprocess
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, TimeoutError as TooSlow
from contextlib import contextmanager, suppress
from typing import IO, Any

from labrig.acquire import LIGHTS, RigFile
from labrig.foundation.errors import DeviceError
from labrig.foundation.own_process import own_process
from labrig.foundation.quantity import duration_text

#: Messages to the guard: a light may be on, or all are off.
MAY_BE_ON, ALL_OFF = b"+", b"-"
#: Message of the guard when it is ready.
READY = "ready"
HEARTBEAT_INTERVAL_S = 1.0
#: Silence after which labrig counts as hung, longer than any call that holds the interpreter.
HANG_TIMEOUT_S = 30
#: Duration of the attempts to switch a light off: its board may have to be plugged in again.
TRIES_FOR_S = 300.0
#: Importing the drivers takes a second, or several on a busy PC.
STARTS_WITHIN_S = 60.0
ENDS_WITHIN_S = 10.0


@contextmanager
def guarding(file: RigFile, source: str) -> Iterator["Guard | None"]:
    """Provide a guard for a rig's lights, not started yet; None without lights."""
    lights = {key: entry for key, entry in file.devices.items() if key in LIGHTS}
    if not lights:
        yield None
        return
    guard = Guard(RigFile(name=file.name, devices=lights), source)
    try:
        yield guard
    finally:
        guard.close()


class Guard:
    """Starts the guard's process and reports to it, from a thread, that this process is alive.

    Parameters
    ----------
    file
        Rig file with the lights alone.
    source
        Path of the rig file, for messages.
    """

    described = (
        "a process of its own: it switches the lights off at once if labrig dies, and after "
        f"{HANG_TIMEOUT_S} s if labrig hangs"
    )
    goes_on = f"its guard goes on trying for {duration_text(TRIES_FOR_S)}"

    def __init__(self, file: RigFile, source: str) -> None:
        self.lights = frozenset(file.devices)
        self._order = {
            "file": file.model_dump(mode="json", exclude_none=True),
            "source": source,
            "pid": os.getpid(),
        }
        self._state = ALL_OFF
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._beating = threading.Thread(target=self._beat, daemon=True)

    @property
    def is_started(self) -> bool:
        """The guard was started: a light may have been lit since the devices were opened."""
        return self._process is not None

    def lights_may_be_on(self, may_be: bool) -> None:
        """Report it at once; the guard is started before the first light."""
        self.watch() if may_be else self.stand_down()

    def watch(self) -> None:
        """Start the guard if necessary, and report that a light may be on.

        Raises
        ------
        DeviceError
            The guard cannot be started.
        """
        self._tell(MAY_BE_ON)
        if not self._beating.is_alive():
            self._beating.start()

    def stand_down(self) -> None:
        """Report that all lights are off, as read back."""
        if self._process is not None:
            self._tell(ALL_OFF)

    def close(self) -> None:
        """End the guard if all lights are off; otherwise leave it to switch them off."""
        self._closed.set()
        if self._beating.is_alive():
            self._beating.join()
        if self._process is not None:
            self._pipe.close()
            if self._state == ALL_OFF:
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(ENDS_WITHIN_S)
                self._process.kill()  # nobody needs it any more
                self._process.wait()

    def _beat(self) -> None:
        while not self._closed.wait(HEARTBEAT_INTERVAL_S):
            with self._lock, suppress(DeviceError):  # tried again with the next beat
                self._send()

    def _tell(self, state: bytes) -> None:
        with self._lock:
            self._state = state
            self._send()

    def _send(self) -> None:
        """Report the state, to a new guard if the old one was killed."""
        if self._process is not None and self._process.poll() is not None:
            self._pipe.close()
            self._process = None
        if self._process is None:
            self._process = _started(self._order)
        with suppress(OSError):  # it died just now, which the next beat finds out
            self._pipe.write(self._state)

    @property
    def _pipe(self) -> IO[bytes]:
        assert self._process is not None
        assert self._process.stdin is not None
        return self._process.stdin


def _started(order: dict[str, Any]) -> "subprocess.Popen[bytes]":
    """Start the guard's process and return it once it is ready.

    Raises
    ------
    DeviceError
        The process cannot be started, or does not get ready.
    """
    try:
        process: subprocess.Popen[bytes] = own_process(
            "labrig.bench.guard_process",
            windows_flags="DETACHED_PROCESS",
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,
        )
    except OSError as error:
        raise _cannot_start(str(error)) from None
    assert process.stdin is not None
    assert process.stdout is not None
    answer = "it ended at once"
    with process.stdout, suppress(OSError), ThreadPoolExecutor(1) as reader:
        process.stdin.write(json.dumps(order).encode() + b"\n")
        line = reader.submit(process.stdout.readline)
        try:
            answer = line.result(STARTS_WITHIN_S).decode(errors="replace").strip()
        except TooSlow:
            process.kill()  # which ends its line, too
            answer = f"no answer within {STARTS_WITHIN_S:g} s"
    if answer == READY:
        return process
    process.kill()
    process.wait()
    process.stdin.close()
    raise _cannot_start(answer)


def _cannot_start(reason: str) -> DeviceError:
    return DeviceError(
        f"the guard, which switches the lights off if labrig dies, cannot start ({reason}); "
        "without it no light is lit"
    )
