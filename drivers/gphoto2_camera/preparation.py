"""Settings of a camera before a PC photographs with it: single RAW frames, to the PC alone."""

from collections.abc import Callable

from labrig.foundation.errors import DeviceError

from .labels import is_raw_alone
from .library import Library

#: Names of settings, which differ by make.
FORMAT = ("imageformat", "imagequality")
TARGET = ("capturetarget",)
#: Number of frames for which there is room, on the card or the PC.
ROOM = "availableshots"
DRIVE = ("drivemode", "capturemode")
#: libgphoto2's own switch, whether it has a Nikon focus before each frame.
AUTOFOCUS = ("autofocus",)


def prepare(library: Library, answer_s: float) -> None:
    """Apply all these settings, as far as the camera has them, and read them back.

    Parameters
    ----------
    answer_s
        Seconds until the camera must have taken a setting.

    Raises
    ------
    DeviceError
        The camera offers no RAW, or did not take one of the settings.
    """
    _send_frames_to_pc(library, answer_s)
    _set_where(library, DRIVE, lambda label: label.startswith("Single"), answer_s)
    _set_where(library, AUTOFOCUS, lambda label: label == "Off", answer_s)
    name = library.first_of(FORMAT)
    if name is not None and not _set_where(library, (name,), is_raw_alone, answer_s):
        setting = library.get(name)
        raise DeviceError(
            f"expected a camera that can be set to RAW alone, its {name} is {setting.value} and "
            f"may be {', '.join(setting.choices) or 'nothing else'}: set RAW in its menu, or use "
            "another camera"
        )


def _send_frames_to_pc(library: Library, answer_s: float) -> None:
    name = library.first_of(TARGET)
    if name is None:
        return
    target = library.get(name)
    to_pc = [label for label in target.choices if "ram" in label.lower() and "+" not in label]
    other_names = [label for label in target.choices if label not in to_pc]
    is_full = library.has(ROOM) and library.get(ROOM).value == "0"
    if other_names and is_full:
        # a Canon is told of the PC's room only when the target changes, and forgets it
        # when a program dies
        library.set_and_verify(name, other_names[0], answer_s)
    if to_pc:
        library.set_and_verify(name, to_pc[0], answer_s)


def _set_where(
    library: Library, names: tuple[str, ...], is_meant: Callable[[str], bool], answer_s: float
) -> bool:
    """Set the first of `names` that exists to its first suitable choice; return whether done."""
    name = library.first_of(names)
    if name is None:
        return False
    setting = library.get(name)
    if is_meant(setting.value):
        return True
    label = next(filter(is_meant, setting.choices), None)
    if label is not None:
        library.set_and_verify(name, label, answer_s)
    return label is not None
