"""Cameras whose curves are shipped, and which of them a camera is by its own name."""

import json
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from labrig.foundation import resources
from labrig.foundation.input_file import read_text

#: Folder of the files, JSON as rawtoaces writes it.
FOLDER = "config/optics/cameras"
#: Names of the same model elsewhere in the world.
OTHER_NAMES = {
    "EOS 100D": ("EOS Rebel SL1", "EOS Kiss X7"),
    "EOS 200D": ("EOS Rebel SL2", "EOS Kiss X9"),
    "EOS 200D II": ("EOS 250D", "EOS Rebel SL3", "EOS Kiss X10"),
    "EOS 600D": ("EOS Rebel T3i", "EOS Kiss X5"),
    "EOS R5m2": ("EOS R5 Mark II",),
    "EOS R6m2": ("EOS R6 Mark II",),
    "Digital Rebel XTi": ("EOS Digital Rebel XTi", "EOS 400D Digital", "EOS Kiss Digital X"),
}
#: Words of makers' names that are no part of it.
COMPANY = {"co", "company", "corp", "corporation", "inc", "ltd"}


@dataclass(frozen=True)
class ShippedCamera:
    """A camera whose curves are shipped.

    Attributes
    ----------
    name
        Name of the shipped file, for rig files and commands.
    maker, model
        Names in the file's header.
    path
        Path of the file.
    """

    name: str
    maker: str
    model: str
    path: Path

    def is_called(self, camera: str) -> bool:
        """Whether that is how the camera calls itself, with or without its maker."""
        maker, asked = _words(self.maker), _words(camera)
        models = {_key(_words(model)) for model in (self.model, *OTHER_NAMES.get(self.model, ()))}
        while asked[: len(maker)] == maker:
            asked = asked[len(maker) :]
        return _key(asked) in models


@cache
def shipped_cameras() -> tuple[ShippedCamera, ...]:
    """Return the cameras whose curves are shipped, by name.

    Returns
    -------
    tuple of ShippedCamera
        Name, maker, model and file of each.

    Examples
    --------
    >>> from labrig.optics import shipped_cameras
    >>> [camera.name for camera in shipped_cameras() if camera.maker == "Fujifilm"]
    ['fujifilm_gfx_100', 'fujifilm_x_t3', 'fujifilm_x_t4']
    """
    cameras = []
    for name, path in resources.names(FOLDER).items():
        header = json.loads(read_text(path))["header"]
        cameras.append(ShippedCamera(name, header["manufacturer"], header["model"], path))
    return tuple(cameras)


def shipped_camera(camera: str) -> ShippedCamera | None:
    """Return the shipped camera that calls itself so, as in EXIF or on USB.

    Parameters
    ----------
    camera
        Maker and model, or the model alone, in any case.

    Returns
    -------
    ShippedCamera or None
        None if no curves of that model are shipped.

    Examples
    --------
    >>> from labrig.optics import shipped_camera
    >>> [
    ...     shipped_camera(text).name
    ...     for text in ("Canon EOS REBEL T3i", "NIKON CORPORATION NIKON D850", "SONY ILCE-7M3")
    ... ]
    ['canon_eos_600d', 'nikon_d850', 'sony_ilce_7m3']
    >>> shipped_camera("Canon EOS 5D Mark VI") is None
    True
    """
    return next((one for one in shipped_cameras() if one.is_called(camera)), None)


def _words(text: str) -> list[str]:
    words: list[str] = re.findall(r"[a-z0-9]+", text.casefold())
    return [word for word in words if word not in COMPANY]


def _key(words: list[str]) -> str:
    return "".join(words)
