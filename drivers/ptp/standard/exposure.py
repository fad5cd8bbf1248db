"""Shutter time, aperture and sensitivity by the standard's own properties.

The shutter time is a number of 0.1 ms, which the camera rounds, and most makers round to the dial's
nominal time (1/60 s is 16.6 ms), whatever the actual one. The number is used as it comes.
"""

import math
from collections.abc import Iterable, Sequence

from labrig.acquire import CameraCapabilities, ExposureSettings, frame_bytes
from labrig.foundation.errors import DeviceError

from ..codes import StandardProperty
from ..settings import PtpCameraSettings
from .properties import PropertyDescription, StandardProperties

#: Units of ExposureTime per second.
UNITS_PER_S = 10_000
#: Fewest units, of which rounding is up to 2 %; shorter times are useless for photometry.
MIN_UNITS = 25
#: Units of FNumber: hundredths.
F_NUMBER_UNITS = 100
#: Values of ExposureIndex; 0 is "undefined".
AUTO_ISO, NO_ISO = 0xFFFF, 0
#: Tolerances of requested settings: neighbours are 1/6 stop and 6 % apart.
SAME_SHUTTER_STOPS = 0.1
SAME_F_NUMBER = 0.02
#: Shutter times where a camera gives bounds only: thirds of a stop from 1/512 s to 1024 s.
_THIRDS_S = tuple(2.0 ** (third / 3) for third in range(-27, 31))


class StandardExposure:
    """The exposure settings behind `StandardProperties`.

    Parameters
    ----------
    properties
        Properties that the camera reports.
    settings
        The rig file's keys for the camera.
    isos
        Sensitivities that may be used.
    """

    def __init__(
        self,
        properties: StandardProperties,
        settings: PtpCameraSettings,
        isos: Sequence[int],
    ) -> None:
        self._properties = properties
        self._settings = settings
        self._isos = isos

    def capabilities(self) -> CameraCapabilities:
        """Return the camera's own lists, less what the rig file excludes.

        Raises
        ------
        DeviceError
            The camera does not report its shutter time or ISO, or offers none that the rig allows.
        """
        units = self._shutter_choices(self._shutter())
        isos = self._iso_choices(self._iso())
        if not units or not isos:
            missing = "isos" if units else "shutter times up to longest_exposure"
            raise DeviceError(
                f"the camera offers none of the rig file's {missing}: set it to manual exposure, "
                "or correct the rig file"
            )
        return CameraCapabilities(
            exposures_s=tuple(sorted(choice / UNITS_PER_S for choice in units)),
            isos=tuple(sorted(isos)),
            f_numbers=tuple(sorted(self._f_number_choices(self._aperture()))),
            overhead_s=self._settings.frame_time,
            change_s=self._settings.change_time,
            frame_bytes=frame_bytes(self._settings.frame_size, self._settings.frame_pixels),
            frame_pixels=self._settings.frame_pixels,
        )

    def apply(self, requested: ExposureSettings) -> None:
        """Set what is not in force already, read back.

        Raises
        ------
        DeviceError
            The camera does not offer a setting or did not take it.
        """
        if not requested.exposure_s > 0:
            raise DeviceError(
                f"expected a shutter time longer than 0 s, asked for {requested.exposure_s} s: "
                "correct the protocol"
            )
        shutter, iso, aperture = self._shutter(), self._iso(), self._aperture()
        units = _nearest(requested.exposure_s * UNITS_PER_S, self._shutter_choices(shutter))
        if units is None or requested.iso not in self._iso_choices(iso):
            missing = "shutter time" if units is None else "ISO"
            raise DeviceError(
                f"asked the camera for {requested}, and it does not offer this {missing}: choose "
                "one of those that 'labrig rig check' shows, or set it to manual exposure"
            )
        self._set(StandardProperty.exposure_time, shutter, units, requested)
        if iso is not None:
            self._set(StandardProperty.exposure_index, iso, requested.iso, requested)
        if requested.f_number is not None:
            self._set_aperture(aperture, requested.f_number, requested)

    def in_force(self) -> ExposureSettings:
        """Return the settings that the camera reports.

        Raises
        ------
        DeviceError
            The camera reports none, or is at automatic ISO or at a shutter time without an end.
        """
        shutter, iso, aperture = self._shutter(), self._iso(), self._aperture()
        if not self._is_usable(shutter.value):
            raise DeviceError(
                f"expected a shutter time from {MIN_UNITS / UNITS_PER_S * 1e3:g} ms to the rig "
                f"file's longest_exposure, the camera says {shutter.value} x 0.1 ms for its "
                f"{StandardProperty.exposure_time}: set it to manual exposure, not to bulb"
            )
        if iso is not None and iso.value in (NO_ISO, AUTO_ISO):
            raise DeviceError(
                f"expected a fixed ISO, the camera says 0x{iso.value:X} for its "
                f"{StandardProperty.exposure_index}: switch automatic ISO off"
            )
        return ExposureSettings(
            shutter.value / UNITS_PER_S,
            self._iso_choices(None)[0] if iso is None else iso.value,
            None if aperture is None else _f_number(aperture.value),
        )

    def _shutter(self) -> PropertyDescription:
        shutter = self._properties.describe(StandardProperty.exposure_time)
        if shutter is None:
            raise DeviceError(
                f"expected a camera that reports its {StandardProperty.exposure_time}, this one "
                "does not: use another camera"
            )
        return shutter

    def _iso(self) -> PropertyDescription | None:
        return self._properties.describe(StandardProperty.exposure_index)

    def _aperture(self) -> PropertyDescription | None:
        return self._properties.describe(StandardProperty.f_number)

    def _shutter_choices(self, shutter: PropertyDescription) -> list[int]:
        listed = shutter.settable_to([round(time_s * UNITS_PER_S) for time_s in _THIRDS_S])
        return [units for units in listed if self._is_usable(units)]

    def _is_usable(self, units: int) -> bool:
        return units >= MIN_UNITS and self._settings.allows_exposure(units / UNITS_PER_S)

    def _iso_choices(self, iso: PropertyDescription | None) -> Sequence[int]:
        if iso is not None:
            return [listed for listed in iso.settable_to(self._isos) if listed in self._isos]
        if len(self._isos) != 1:
            raise DeviceError(
                f"expected a camera that reports its {StandardProperty.exposure_index}, this one "
                "does not: set it by hand, and write that one alone into the rig file's 'isos'"
            )
        return self._isos

    def _f_number_choices(self, aperture: PropertyDescription | None) -> list[float]:
        if aperture is None:
            return []
        rig = [round(number * F_NUMBER_UNITS) for number in self._settings.f_numbers]
        numbers = (_f_number(units) for units in aperture.settable_to(rig))
        return [number for number in numbers if number is not None]

    def _set_aperture(
        self, aperture: PropertyDescription | None, f_number: float, requested: ExposureSettings
    ) -> None:
        offered = self._f_number_choices(aperture)
        matching = [number for number in offered if abs(number / f_number - 1) < SAME_F_NUMBER]
        if aperture is None or not matching:
            raise DeviceError(
                f"asked the camera for {requested}, "
                + (
                    f"its lens offers {', '.join(f'f/{number:g}' for number in offered)}: choose "
                    "one of these"
                    if offered
                    else "it does not report the aperture of its lens: set it by hand and leave "
                    "f_number out"
                )
            )
        units = round(matching[0] * F_NUMBER_UNITS)
        self._set(StandardProperty.f_number, aperture, units, requested)

    def _set(
        self,
        prop: StandardProperty,
        described: PropertyDescription,
        value: int,
        requested: ExposureSettings,
    ) -> None:
        reported = self._properties.set(prop, described, value)
        if reported != value:
            raise DeviceError(
                f"asked the camera for {requested}, its {prop} = {value}, it says {reported}: "
                "set it to manual exposure, leave its menus, and try again"
            )


def labelled_times_s(label_s: float) -> tuple[float, ...]:
    """Return the times in seconds that cameras tell of a dial's label, by the way of counting.

    It is the nominal time, cut off or rounded to 0.1 ms, or the actual one in thirds of a stop.
    """
    actual_s = 2.0 ** (round(math.log2(label_s) * 3) / 3)
    units = (
        math.floor(label_s * UNITS_PER_S),
        *(round(t * UNITS_PER_S) for t in (label_s, actual_s)),
    )
    return tuple(each / UNITS_PER_S for each in units)


def _f_number(units: int) -> float | None:
    """Return the f-number; None where the lens reports none."""
    return units / F_NUMBER_UNITS if 0 < units < 0xFFFF else None


def _nearest(units: float, among: Iterable[int]) -> int | None:
    """Return the shutter time that `units` stands for, as offered or as on a dial."""
    off_stops = {choice: abs(math.log2(choice / units)) for choice in among}
    nearest = min(off_stops, key=off_stops.__getitem__, default=None)
    return None if nearest is None or off_stops[nearest] > SAME_SHUTTER_STOPS else nearest
