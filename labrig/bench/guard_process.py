"""The guard's process, which switches the lights off when labrig dies or hangs.

    python -P -m labrig.bench.guard_process

It reads from its standard input a line of JSON with the lights to switch off, then a byte per
second that says whether a light may be on. The end of its input is the end of labrig.
"""

import json
import os
import queue
import signal
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import BinaryIO

from labrig.acquire import RigFile, load_driver
from labrig.bench.guard import (
    ALL_OFF,
    HANG_TIMEOUT_S,
    HEARTBEAT_INTERVAL_S,
    MAY_BE_ON,
    READY,
    TRIES_FOR_S,
)
from labrig.bench.opening import Bench
from labrig.bench.serial_ports import SerialPorts
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import LabrigError

#: Pauses between two attempts. The first ones are short: the port of a killed process is free some
#: milliseconds after its end.
FIRST_PAUSE_S, MAX_PAUSE_S = 0.02, 2.0


def main() -> None:
    """Serve one labrig until all lights are off."""
    # What ends labrig is what the guard is there for.
    for signum in signal.valid_signals():
        with suppress(OSError, ValueError):  # SIGKILL and SIGSTOP
            signal.signal(signum, signal.SIG_IGN)
    source = sys.stdin.buffer
    order = json.loads(source.readline())
    try:
        lights = Lights(RigFile.model_validate(order["file"]), order["source"])
    except LabrigError as error:
        print(error, flush=True)
        return
    print(READY, flush=True)
    for descriptor in (1, 2):  # nobody reads what is printed from now on
        os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
    if labrig_is_gone(source, order["pid"]):
        lights.switch_off()


def labrig_is_gone(source: BinaryIO, pid: int) -> bool:
    """Wait until labrig has ended or was killed as hung; return whether a light may be on."""
    messages: queue.Queue[bytes] = queue.Queue()
    threading.Thread(target=_listen, args=(source, messages), daemon=True).start()
    state, silent_s = ALL_OFF, 0.0
    while True:
        try:
            message = messages.get(timeout=HEARTBEAT_INTERVAL_S)
        except queue.Empty:
            # Counted, not looked up on a clock: a PC that slept has not been silent.
            silent_s += HEARTBEAT_INTERVAL_S
            if state == MAY_BE_ON and silent_s >= HANG_TIMEOUT_S:
                _kill(pid)
                return True
            continue
        if not message:
            return state == MAY_BE_ON
        state, silent_s = message, 0.0


class Lights:
    """Lights of a rig that another process runs, to be switched off after its end.

    Parameters
    ----------
    file
        Rig file with the lights alone.
    source
        Path of the rig file, for messages.

    Raises
    ------
    UsageError
        A driver is not installed.
    """

    def __init__(self, file: RigFile, source: str) -> None:
        self._clock = SystemClock()
        self._benches = []
        ports = SerialPorts()
        for key, entry in file.devices.items():
            load_driver(key, entry.driver, source)  # imported now, not in an emergency
            for address in entry.addresses():
                ports.look_up(address)
            single = file.model_copy(update={"devices": {key: entry}})
            self._benches.append(Bench(single, source, self._clock, None, ports=ports))

    def switch_off(self) -> None:
        """Switch all lights off in parallel, trying for up to `TRIES_FOR_S`."""
        with ThreadPoolExecutor(len(self._benches)) as pool:
            list(pool.map(self._switch_off, self._benches))

    def _switch_off(self, bench: Bench) -> None:
        deadline_s, pause_s = self._clock.now() + TRIES_FOR_S, FIRST_PAUSE_S
        is_off = False
        while not is_off and self._clock.now() < deadline_s:
            try:
                with bench.devices():
                    is_off = True  # what is opened was switched off and read back
            except Exception:  # nobody is there to be told, and the next try may do it
                self._clock.sleep(pause_s)
                pause_s = min(2 * pause_s, MAX_PAUSE_S)


def _listen(source: BinaryIO, messages: "queue.Queue[bytes]") -> None:
    while message := source.read(1):
        messages.put(message)
    messages.put(b"")


def _kill(pid: int) -> None:
    """Kill a hung labrig by SIGKILL or the equivalent on Windows."""
    if sys.platform == "win32" or os.getppid() == pid:  # else it has ended, and the number is free
        with suppress(OSError):
            os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))


if __name__ == "__main__":
    main()
