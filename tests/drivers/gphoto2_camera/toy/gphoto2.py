"""Stands in for python-gphoto2 in the driver's helper process: one camera, as a file describes it.

The environment's `GPHOTO2_TOY` names a JSON file with the `Toy`'s fields; what is set is written
to the file beside it with `.log`.
"""

import json
import os
import time
from pathlib import Path
from typing import Any

GP_EVENT_UNKNOWN, GP_EVENT_TIMEOUT, GP_EVENT_FILE_ADDED = 0, 1, 2
GP_WIDGET_WINDOW, GP_WIDGET_SECTION, GP_WIDGET_TEXT, GP_WIDGET_RANGE = 0, 1, 2, 3
GP_WIDGET_TOGGLE, GP_WIDGET_RADIO, GP_WIDGET_MENU, GP_WIDGET_BUTTON = 4, 5, 6, 7
GP_FILE_TYPE_NORMAL, GP_VERSION_SHORT = 1, 0
GP_ERROR_BAD_PARAMETERS, GP_ERROR_NOT_SUPPORTED = -2, -6
GP_ERROR_MODEL_NOT_FOUND, GP_ERROR_CAMERA_BUSY = -105, -110


class GPhoto2Error(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(f"[{code}] toy")
        self.code = code
        self.string = "toy"


class Toy:
    """What the file says.

    Attributes
    ----------
    settings
        Name → [value, choices…].
    stuck
        Settings that take a value and keep the one they have.
    files
        What each photograph delivers: pairs of name and content.
    busy
        So many triggers are answered "busy" first, although they are obeyed.
    busy_s
        For so many seconds after a trigger waits for an event are answered "busy".
    preview
        The live picture; empty where there is no live view.
    models
        What is detected: port path → model.
    """

    def __init__(self) -> None:
        self.path = Path(os.environ["GPHOTO2_TOY"])
        content: dict[str, Any] = json.loads(self.path.read_text())
        self.settings: dict[str, list[str]] = content["settings"]
        self.stuck: list[str] = content.get("stuck", [])
        self.files: list[list[str]] = content.get("files", [])
        self.busy: int = content.get("busy", 0)
        self.busy_s: float = content.get("busy_s", 0.0)
        self.preview = bytes.fromhex(content.get("preview", ""))
        self.models: dict[str, str] = content.get("models", {})

    def log(self, line: str) -> None:
        with self.path.with_suffix(".log").open("a") as file:
            file.write(line + "\n")


class Widget:
    def __init__(self, name: str, labels: list[str]) -> None:
        self.name = name
        self.value, *self.choices = labels

    def get_name(self) -> str:
        return self.name

    def get_type(self) -> int:
        return GP_WIDGET_RADIO if self.choices else GP_WIDGET_TEXT

    def get_value(self) -> str:
        return self.value

    def set_value(self, value: str) -> None:
        self.value = value

    def get_choices(self) -> list[str]:
        return self.choices


class Window:
    def __init__(self, children: list[Widget]) -> None:
        self._children = children

    def get_type(self) -> int:
        return GP_WIDGET_WINDOW

    def get_children(self) -> list[Widget]:
        return self._children


class File:
    def __init__(self, folder: str, name: str, content: bytes = b"") -> None:
        self.folder, self.name, self._content = folder, name, content

    def get_data_and_size(self) -> bytes:
        return self._content


class Camera:
    def __init__(self) -> None:
        self._toy = Toy()
        self._reported: list[list[str]] = []
        self._busy_until_s = 0.0
        self._kept: dict[str, bytes] = {}

    def set_port_info(self, info: str) -> None:
        self._toy.log(f"port {info}")

    def set_abilities(self, model: str) -> None:
        self._toy.log(f"model {model}")

    def init(self) -> None:
        pass

    def get_config(self) -> Window:
        return Window([self.get_single_config(name) for name in self._toy.settings])

    def get_single_config(self, name: str) -> Widget:
        return Widget(name, list(self._toy.settings[name]))

    def set_single_config(self, name: str, widget: Widget) -> None:
        if widget.choices and widget.value not in widget.choices:
            raise GPhoto2Error(GP_ERROR_BAD_PARAMETERS)
        self._toy.log(f"{name}={widget.value}")
        if name not in self._toy.stuck:
            self._toy.settings[name][0] = widget.value

    def trigger_capture(self) -> None:
        self._toy.log("trigger")
        self._busy_until_s = time.monotonic() + self._toy.busy_s
        if self._toy.files:
            self._reported.append(self._toy.files.pop(0))
        if self._toy.busy:
            self._toy.busy -= 1
            raise GPhoto2Error(GP_ERROR_CAMERA_BUSY)

    def wait_for_event(self, _timeout_ms: int) -> tuple[int, Any]:
        if time.monotonic() < self._busy_until_s:
            raise GPhoto2Error(GP_ERROR_CAMERA_BUSY)
        if not self._reported:
            return GP_EVENT_TIMEOUT, None
        name, content = self._reported.pop(0)
        self._kept[name] = bytes.fromhex(content)
        return GP_EVENT_FILE_ADDED, File("/", name)

    def file_get(self, folder: str, name: str, _kind: int) -> File:
        return File(folder, name, self._kept[name])

    def capture_preview(self) -> File:
        self._toy.log("preview")
        if not self._toy.preview:
            raise GPhoto2Error(GP_ERROR_NOT_SUPPORTED)
        return File("/", "preview.jpg", self._toy.preview)

    def exit(self) -> None:
        self._toy.log("exit")


class PortInfoList(list[str]):
    def load(self) -> None:
        pass

    def lookup_path(self, path: str) -> int:
        self.append(path)
        return len(self) - 1


class Detected:
    def __init__(self, found: list[tuple[str, str]]) -> None:
        self._found = found

    def count(self) -> int:
        return len(self._found)

    def get_value(self, index: int) -> str:
        return self._found[index][0]

    def get_name(self, index: int) -> str:
        return self._found[index][1]


class CameraAbilitiesList(list[str]):
    def load(self) -> None:
        pass

    def detect(self, _ports: PortInfoList) -> Detected:
        return Detected(list(Toy().models.items()))

    def lookup_model(self, model: str) -> int:
        self.append(model)
        return len(self) - 1


def gp_library_version(_verbosity: int) -> list[str]:
    return ["toy"]
