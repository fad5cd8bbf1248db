"""Shutter time, aperture and sensitivity: the camera's offers, settings in force, setting them."""

from collections.abc import Callable
from typing import TypeVar

from labrig.acquire import CameraCapabilities, ExposureSettings
from labrig.foundation.errors import DeviceError

from .labels import SAME_F_NUMBER, f_number, iso, label_of_time, true_times_s
from .library import Library, Setting
from .settings import Gphoto2CameraSettings

#: Names differ by make; where a camera has two, the first is the finer one.
SHUTTER = ("shutterspeed2", "shutterspeed")
ISO = ("iso",)
APERTURE = ("aperture", "f-number")
MODE = ("autoexposuremode", "expprogram")
MANUAL = ("Manual", "M")

T = TypeVar("T")


class Exposure:
    """The exposure settings of a connected camera.

    Raises
    ------
    DeviceError
        Shutter time or sensitivity cannot be set by libgphoto2.
    """

    def __init__(self, library: Library, settings: Gphoto2CameraSettings) -> None:
        self._library = library
        self._settings = settings
        self._shutter = _needed(library, SHUTTER, "shutter time")
        self._iso = _needed(library, ISO, "sensitivity (ISO)")
        self._aperture = library.first_of(APERTURE)

    def capabilities(self) -> CameraCapabilities:
        """Return the camera's own lists, less what the rig file excludes.

        Raises
        ------
        DeviceError
            The rig file excludes all settings that the camera offers.
        """
        self._require_manual()
        exposures_s = self._times_s(self._library.get(self._shutter)).values()
        isos = _values_by_label(self._library.get(self._iso), iso)
        allowed = set(isos.values()) & set(self._settings.isos)
        if not exposures_s or not allowed:
            missing = "isos" if exposures_s else "shutter times up to longest_exposure"
            raise DeviceError(
                f"the camera offers none of the rig file's {missing}: turn its dial to M, or "
                "correct the rig file"
            )
        return self._settings.capabilities(exposures_s, allowed, self._apertures().values())

    def apply(self, requested: ExposureSettings) -> None:
        """Set what is not in force already, read back.

        Raises
        ------
        DeviceError
            The camera does not offer a setting or did not take it.
        """
        self._require_manual()
        for name, label in self._labels_of(requested).items():
            self._library.set_and_verify(name, label, self._settings.answer_timeout)

    def in_force(self) -> ExposureSettings:
        """Return the settings that the camera reports, with the actual shutter time.

        Raises
        ------
        DeviceError
            The camera is at bulb, at automatic ISO, at something unknown, or its dial not at M.
        """
        self._require_manual()
        shutter, sensitivity = self._library.get(self._shutter), self._library.get(self._iso)
        exposure_s = self._times_s(shutter).get(shutter.value)
        if exposure_s is None:
            raise _unusable("shutter time", shutter.value)
        value = iso(sensitivity.value)
        if value is None:
            raise _unusable("ISO", sensitivity.value)
        aperture = None if self._aperture is None else self._library.get(self._aperture).value
        return ExposureSettings(exposure_s, value, None if aperture is None else f_number(aperture))

    def _labels_of(self, requested: ExposureSettings) -> dict[str, str]:
        """Return the label of each exposure setting by the setting's name."""
        times_s = self._times_s(self._library.get(self._shutter))
        isos = _values_by_label(self._library.get(self._iso), iso)
        shutter = label_of_time(requested.exposure_s, times_s) if requested.exposure_s > 0 else None
        sensitivity = next((label for label, value in isos.items() if value == requested.iso), None)
        if shutter is None or sensitivity is None:
            missing = "shutter time" if shutter is None else "ISO"
            raise DeviceError(
                f"asked the camera for {requested}, and it does not offer this {missing}: choose "
                "one of those that 'labrig rig check' shows, or turn its dial to M"
            )
        labels = {self._shutter: shutter, self._iso: sensitivity}
        if requested.f_number is not None:
            labels |= self._aperture_label(requested, requested.f_number)
        return labels

    def _aperture_label(
        self, requested: ExposureSettings, requested_f_number: float
    ) -> dict[str, str]:
        offered = self._apertures()
        for label, value in offered.items():
            if self._aperture is not None and abs(value / requested_f_number - 1) < SAME_F_NUMBER:
                return {self._aperture: label}
        raise DeviceError(
            f"asked the camera for {requested}, "
            + (
                f"its lens offers {', '.join(f'f/{value:g}' for value in offered.values())}: "
                "choose one of these"
                if offered
                else "it cannot set the aperture of its lens: set it by hand and leave f_number out"
            )
        )

    def _times_s(self, shutter: Setting) -> dict[str, float]:
        times_s = true_times_s(shutter.choices)
        allows = self._settings.allows_exposure
        return {label: time_s for label, time_s in times_s.items() if allows(time_s)}

    def _apertures(self) -> dict[str, float]:
        return (
            {}
            if self._aperture is None
            else _values_by_label(self._library.get(self._aperture), f_number)
        )

    def _require_manual(self) -> None:
        mode = self._library.first_of(MODE)
        if mode is not None and (label := self._library.get(mode).value) not in MANUAL:
            raise DeviceError(
                f"expected the camera's dial at M, it says {label}: turn the dial to M"
            )


def _values_by_label(setting: Setting, meaning: Callable[[str], T | None]) -> dict[str, T]:
    """Return the labels with a known value, and their values."""
    return {label: value for label in setting.choices if (value := meaning(label)) is not None}


def _needed(library: Library, names: tuple[str, ...], purpose: str) -> str:
    name = library.first_of(names)
    if name is None:
        raise DeviceError(
            f"libgphoto2 cannot set the {purpose} of this camera, as it has no "
            f"{' or '.join(names)}: turn its dial to M, or use another camera"
        )
    return name


def _unusable(quantity: str, label: str) -> DeviceError:
    return DeviceError(
        f"expected a {quantity} that can be reduced, the camera says {label}: turn its dial to M, "
        "neither bulb nor automatic ISO"
    )
