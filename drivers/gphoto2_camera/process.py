"""libgphoto2 in a process of its own.

Its calls block, for minutes if a camera hangs, some of them in Python's lock; and it has crashed.
In a process of its own neither keeps Ctrl-C from being handled or the lamp from being switched off:
the process is ended, and another one started.
"""

import importlib.util
import os
import subprocess
import sys
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from labrig.foundation.clock import CHECK_INTERVAL_S, Clock
from labrig.foundation.errors import DeviceLostError, UsageError

from .failures import failure

HELPER = Path(__file__).with_name("helper.py")
#: Time within which a process ends on command.
END_S = 5.0


class HelperProcess:
    """Process that runs libgphoto2; it gets one request after the other, awaited on the clock.

    Parameters
    ----------
    clock
        Clock of the waiting for answers, during which a request to stop is noticed.
    name
        Name of the camera in messages.
    """

    def __init__(self, clock: Clock, name: str) -> None:
        self._clock = clock
        self._name = name
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None
        self._owes_answer = False

    def start(self) -> None:
        """Start the process, or start it anew."""
        self.end()
        self._pipe, theirs = Pipe()
        with theirs:
            # -P: nothing beside the helper or in the working folder is taken for a module.
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(HELPER), str(theirs.fileno())],
                env=_environment(),
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C at the terminal is for labrig alone
            )
        self._owes_answer = False

    def ask(self, doing: str, within_s: float, request: str, *arguments: Any) -> Any:
        """Return the result of the helper's `request`.

        Raises
        ------
        DeviceLostError
            The camera is gone, or libgphoto2 hung or crashed and was ended.
        DeviceError
            libgphoto2 failed at the request; `doing` is its purpose in the message.
        Interrupted
            A stop was requested; the answer is still to come.
        """
        context = f"camera {self._name}: {doing}"
        if not self.settle(within_s) or self._pipe is None:
            raise DeviceLostError(f"{context}: libgphoto2 is not running: start again")
        try:
            self._pipe.send((request, *arguments))
            self._owes_answer = True
            if not self._answered(within_s):
                self.end()
                raise DeviceLostError(
                    f"{context}: no answer from libgphoto2 within {within_s:g} s: switch the "
                    "camera off and on"
                )
            code, result = self._pipe.recv()
        except (EOFError, OSError):
            raise DeviceLostError(
                f"{context}: libgphoto2 ended by itself (exit code {self._exit_code()}): switch "
                "the camera off and on; if it happens again: pip install --force-reinstall "
                "'labrig[gphoto2]'"
            ) from None
        self._owes_answer = False
        if code is not None:
            raise failure(context, code, result)
        return result

    def settle(self, within_s: float) -> bool:
        """Return whether the process is ready for the next request; one that hangs is ended."""
        if self._pipe is None:
            return False
        if self._owes_answer:
            try:
                if self._answered(within_s):
                    self._pipe.recv()
                    self._owes_answer = False
            except (EOFError, OSError):
                pass  # it crashed, which is no better than hanging
            if self._owes_answer:
                self.end()
                return False
        return True

    def end(self) -> None:
        """End the process, gently if it is ready for that; never raises."""
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if pipe is not None:
            pipe.close()  # which tells it to leave the camera and to end
        if process is None:
            return
        if not self._owes_answer:
            with suppress(subprocess.TimeoutExpired):
                process.wait(END_S)
        process.kill()
        process.wait()

    def _answered(self, within_s: float) -> bool:
        """Return whether there is an answer; a request to stop is noticed meanwhile."""
        assert self._pipe is not None
        deadline_s = self._clock.now() + within_s
        while True:
            # Looked at before the pipe: this process may be stopped between the two.
            left_s = deadline_s - self._clock.now()
            if self._pipe.poll(min(CHECK_INTERVAL_S, max(0.0, left_s))):
                return True
            if left_s <= 0:
                return False
            self._clock.sleep(0.0)

    def _exit_code(self) -> int | None:
        """Return the exit code of a process that has closed its end of the pipe."""
        process, self._owes_answer = self._process, False
        self.end()
        return None if process is None else process.returncode


def require_gphoto2() -> None:
    """Raise `UsageError` where libgphoto2 is not available."""
    if sys.platform == "win32":
        raise UsageError(
            "the driver gphoto2_camera needs Linux or macOS, for which alone libgphoto2 is made; "
            "on Windows use ptp_camera"
        )
    if importlib.util.find_spec("gphoto2") is None:
        raise UsageError("the driver gphoto2_camera needs an extra: pip install 'labrig[gphoto2]'")


def _environment() -> dict[str, str]:
    """Return the environment with libgphoto2's labels in English."""
    return os.environ | {"LC_ALL": "C", "LANGUAGE": ""}
