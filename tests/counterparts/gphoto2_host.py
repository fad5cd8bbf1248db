"""Drives a camera through python-gphoto2, in a process of its own: `Camera.exit()` holds the GIL.

    python gphoto2_host.py PORT STEP…

prints a JSON list of what each step found: `summary`, `choices:NAME`, `set:NAME=VALUE`,
`capture`, `bulb:SECONDS`, and `wait`, which says that it is there and then waits to be killed.
"""

import hashlib
import json
import sys
import time
from typing import Any

import gphoto2

POLL_MS = 200
MAX_EVENTS = 200
MAX_PRESSES = 10


def connect(port: str) -> Any:
    ports = gphoto2.PortInfoList()
    ports.load()
    abilities = gphoto2.CameraAbilitiesList()
    abilities.load()
    camera = gphoto2.Camera()
    camera.set_port_info(ports[ports.lookup_path(f"ptpip:127.0.0.1:{port}:{port}")])
    camera.set_abilities(abilities[abilities.lookup_model("PTP/IP Camera")])
    camera.init()
    return camera


def set_value(camera: Any, name: str, value: Any) -> None:
    widget = camera.get_single_config(name)
    widget.set_value(value)
    camera.set_single_config(name, widget)


def download(camera: Any, path: Any) -> dict[str, Any]:
    file = camera.file_get(path.folder, path.name, gphoto2.GP_FILE_TYPE_NORMAL)
    data = bytes(file.get_data_and_size())
    digest = hashlib.sha256(data).hexdigest()
    return {"folder": path.folder, "name": path.name, "size": len(data), "sha256": digest}


def capture(camera: Any) -> Any:
    """Press again while the camera is busy, which libgphoto2 leaves to its callers."""
    for _ in range(MAX_PRESSES):
        try:
            return camera.capture(gphoto2.GP_CAPTURE_IMAGE)
        except gphoto2.GPhoto2Error as error:
            if error.code != gphoto2.GP_ERROR_CAMERA_BUSY:
                raise
    raise TimeoutError(f"busy at {MAX_PRESSES} presses")


def bulb(camera: Any, duration_s: float) -> dict[str, Any]:
    set_value(camera, "bulb", 1)
    time.sleep(duration_s)
    set_value(camera, "bulb", 0)
    for _ in range(MAX_EVENTS):
        kind, event = camera.wait_for_event(POLL_MS)
        if kind == gphoto2.GP_EVENT_FILE_ADDED:
            return download(camera, event)
    raise TimeoutError("no file after the bulb exposure")


def wait_to_be_killed() -> None:
    print("here", flush=True)
    time.sleep(600)


def do(camera: Any, step: str) -> Any:
    name, _, argument = step.partition(":")
    match name:
        case "summary":
            return camera.get_summary().text
        case "choices":
            return list(camera.get_single_config(argument).get_choices())
        case "set":
            key, _, value = argument.partition("=")
            set_value(camera, key, value)
            return camera.get_single_config(key).get_value()
        case "capture":
            return download(camera, capture(camera))
        case "bulb":
            return bulb(camera, float(argument))
        case "wait":
            return wait_to_be_killed()
        case _:
            raise ValueError(step)


def main() -> None:
    port, *steps = sys.argv[1:]
    camera = connect(port)
    found = [do(camera, step) for step in steps]
    camera.exit()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
