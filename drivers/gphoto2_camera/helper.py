"""Helper process: calls of libgphoto2, one after another, as requested over a pipe.

    python helper.py DESCRIPTOR

serves the pipe at that file descriptor until the other end is closed. A request is a tuple of a
`Session` method's name and its arguments; the answer is `(None, result)`, or libgphoto2's error as
`(code, text)`. Times are on the clock that all processes of this PC share.
"""

import sys
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

import gphoto2

from labrig.foundation.clock import SystemClock

NETWORK_MODEL = "PTP/IP Camera"
#: An image, as one of the kinds of events.
FILE_ADDED = gphoto2.GP_EVENT_FILE_ADDED

#: Pause before a camera that is busy is asked again for its frame.
BUSY_PAUSE_S = 0.02

_CHOICES = (gphoto2.GP_WIDGET_RADIO, gphoto2.GP_WIDGET_MENU)
_GROUPS = (gphoto2.GP_WIDGET_WINDOW, gphoto2.GP_WIDGET_SECTION)


class Session:
    """One camera, from `connect` on."""

    def __init__(self) -> None:
        self._clock = SystemClock()
        self._camera = gphoto2.Camera()

    def connect(self, path: str) -> dict[str, str]:
        """Connect to the camera at one of libgphoto2's port paths; return its settings by name."""
        ports = gphoto2.PortInfoList()
        ports.load()
        abilities = gphoto2.CameraAbilitiesList()
        abilities.load()
        if path.startswith("ptpip:"):
            model = NETWORK_MODEL
        else:
            cameras = abilities.detect(ports)
            models = {
                cameras.get_value(index): cameras.get_name(index)
                for index in range(cameras.count())
            }
            if path not in models:
                raise gphoto2.GPhoto2Error(gphoto2.GP_ERROR_MODEL_NOT_FOUND)
            model = models[path]
        self._camera.set_port_info(ports[ports.lookup_path(path)])
        self._camera.set_abilities(abilities[abilities.lookup_model(model)])
        self._camera.init()
        return _values(self._camera.get_config(), {})

    def version(self) -> str:
        """Return the version of libgphoto2."""
        return str(gphoto2.gp_library_version(gphoto2.GP_VERSION_SHORT)[0])

    def get(self, name: str) -> tuple[str, tuple[str, ...]]:
        """Return a setting and its choices, if it has some."""
        widget = self._camera.get_single_config(name)
        choices = widget.get_choices() if widget.get_type() in _CHOICES else ()
        return str(widget.get_value()), tuple(choices)

    def set(self, name: str, value: str) -> tuple[float, float]:
        """Set a setting; return the times at which it was sent and answered."""
        widget = self._camera.get_single_config(name)
        is_switch = widget.get_type() == gphoto2.GP_WIDGET_TOGGLE
        widget.set_value(int(value) if is_switch else value)
        sent_s = self._clock.now()
        self._camera.set_single_config(name, widget)
        return sent_s, self._clock.now()

    def trigger(self) -> tuple[float, float]:
        """Photograph; return the times at which libgphoto2 began and reported the end."""
        called_s = self._clock.now()
        self._camera.trigger_capture()
        return called_s, self._clock.now()

    def next_file(self, within_s: float) -> tuple[str, str] | None:
        """Return folder and name of the next file that the camera reports; None without one."""
        deadline_s = self._clock.now() + within_s
        while True:
            remaining_s = deadline_s - self._clock.now()
            try:
                kind, event = self._camera.wait_for_event(max(1, round(remaining_s * 1e3)))
            except gphoto2.GPhoto2Error as error:
                # After 10 s it also asks a Canon to stay awake, which one that exposes refuses.
                if error.code != gphoto2.GP_ERROR_CAMERA_BUSY:
                    raise
                self._clock.sleep(min(max(remaining_s, 0.0), BUSY_PAUSE_S))
            else:
                if kind == FILE_ADDED:
                    return event.folder, event.name
            if remaining_s <= 0:
                return None

    def read(self, folder: str, name: str) -> bytes:
        """Return the bytes of a file."""
        file = self._camera.file_get(folder, name, gphoto2.GP_FILE_TYPE_NORMAL)
        return bytes(file.get_data_and_size())

    def preview(self) -> bytes:
        """Return one picture of the live view."""
        file = self._camera.capture_preview()  # its bytes are freed with it
        return bytes(file.get_data_and_size())

    def leave(self) -> None:
        """Give the camera back to its own buttons."""
        self._camera.exit()


def _values(widget: Any, values: dict[str, str]) -> dict[str, str]:
    """Return all settings below `widget`; of several with one name the first."""
    if widget.get_type() in _GROUPS:
        for child in widget.get_children():
            _values(child, values)
    elif widget.get_type() != gphoto2.GP_WIDGET_BUTTON:
        values.setdefault(widget.get_name(), str(widget.get_value()))
    return values


def serve(pipe: Connection) -> None:
    """Answer requests until the other end of the pipe is closed."""
    session = Session()
    while True:
        try:
            name, *arguments = pipe.recv()
        except (EOFError, ConnectionError):
            break
        try:
            answer = (None, getattr(session, name)(*arguments))
        except gphoto2.GPhoto2Error as error:
            answer = (error.code, error.string)
        pipe.send(answer)
    with suppress(gphoto2.GPhoto2Error):
        session.leave()


if __name__ == "__main__":
    serve(Connection(int(sys.argv[1])))
