"""Checks of a camera's settings that would spoil photometry, as far as libgphoto2 reports them.

Names of settings: libgphoto2 2.5.34, camlibs/ptp2/config.c.
"""

from collections.abc import Iterator

from labrig.acquire import Finding

from .exposure import MANUAL, MODE
from .library import Library
from .preparation import FORMAT
from .release import ButtonRelease, Release

FOCUS = ("focusmode",)
AUTO_ISO = ("isoauto", "autoiso")
LONG_EXPOSURE_NOISE_REDUCTION = ("longexpnr",)
AUTO_POWER_OFF = ("autopoweroff",)

_OFF = ("Off", "off", "0", "No")
_BY_HAND = "look for yourself in the camera's menu"


def findings(library: Library, release: Release, maker: str) -> list[Finding]:
    """Return all findings on the camera's settings.

    Raises
    ------
    DeviceError
        The camera does not answer.
    """
    return [
        _exposure_mode(_value(library, MODE)),
        _focus(_value(library, FOCUS)),
        *_auto_iso(_value(library, AUTO_ISO)),
        _noise_reduction(_value(library, LONG_EXPOSURE_NOISE_REDUCTION)),
        *_auto_power_off(_value(library, AUTO_POWER_OFF)),
        _image_format(_value(library, FORMAT)),
        _shutter_times(maker),
        _release(release),
    ]


def _value(library: Library, names: tuple[str, ...]) -> str | None:
    name = library.first_of(names)
    return None if name is None else library.get(name).value


def _exposure_mode(mode: str | None) -> Finding:
    if mode is None:
        return Finding("warn", "the camera does not report its exposure mode", "turn its dial to M")
    if mode not in MANUAL:
        return Finding("refuse", f"its dial is at {mode}: it chooses exposures", "turn it to M")
    return Finding("fine", "dial at M")


def _focus(mode: str | None) -> Finding:
    if mode is None:
        return Finding("warn", "the camera does not report its focus mode", "set its lens to MF")
    if not mode.startswith(("Manual", "MF", "M")):
        return Finding(
            "refuse",
            f"autofocus is on ({mode}): it delays frames and finds nothing in the dark",
            "set the switch on the lens to MF",
        )
    return Finding("fine", "focus at MF")


def _auto_iso(value: str | None) -> Iterator[Finding]:
    if value is not None and value not in _OFF:
        yield Finding(
            "refuse",
            f"automatic ISO is on ({value}): gain may change between frames",
            "ISO sensitivity settings → automatic ISO → Off",
        )


def _noise_reduction(value: str | None) -> Finding:
    if value is None:
        return Finding(
            "warn",
            "could not read long-exposure noise reduction",
            f"{_BY_HAND} that it is off, and everything else that lightens shadows",
        )
    if value not in _OFF:
        return Finding(
            "refuse",
            f"long-exposure noise reduction is on ({value}): it subtracts a dark frame of its own "
            "and doubles the time of a frame",
            "switch it off in the camera's shooting menu",
        )
    return Finding("fine", "long-exposure noise reduction is off")


def _auto_power_off(value: str | None) -> Iterator[Finding]:
    if value is not None and value not in _OFF:
        yield Finding(
            "warn",
            f"it switches itself off after {value} s; labrig keeps it awake while a run goes on",
            "set automatic switching-off to never",
        )


def _image_format(value: str | None) -> Finding:
    if value is None:
        return Finding(
            "warn",
            "the camera does not report its image format",
            "set its image quality to RAW alone",
        )
    return Finding("fine", f"image format {value}")


def _shutter_times(maker: str) -> Finding:
    if "canon" in maker.lower():
        return Finding("fine", "shutter times are powers of two: 1/60 is 1/64 s, 30 is 32 s")
    return Finding(
        "warn",
        "shutter times are assumed to be powers of two, 1/60 to be 1/64 s, as makers build them",
        "photograph one steady light for 1/4 s and for 2 s: the signals must be as 1 to 8",
    )


def _release(release: Release) -> Finding:
    if isinstance(release, ButtonRelease):
        return Finding("fine", f"released by {release.description}, without delay")
    return Finding(
        "warn",
        f"released by libgphoto2's {release.description}, up to 0.5 s after it is asked; a frame's "
        "begin is taken in the middle of the time in which it may have been",
        "for a Canon EOS the driver ptp_camera knows it better",
    )
