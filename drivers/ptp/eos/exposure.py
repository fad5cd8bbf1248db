"""Shutter time, aperture and sensitivity of an EOS: offers, settings in force, setting them."""

import math
from collections.abc import Collection

from labrig.acquire import CameraCapabilities, ExposureSettings, frame_bytes
from labrig.foundation.errors import DeviceError

from ..session import FIRST_BACK_OFF_S
from ..settings import PtpCameraSettings
from .codes import (
    BULB_TV,
    F_NUMBERS,
    ISOS,
    MIN_BULB_S,
    SAME_SHUTTER_STOPS,
    aperture_code,
    iso_code,
    shutter_code,
    shutter_time_s,
)
from .protocol import BULB_EXPOSURE, MANUAL_EXPOSURE, Property, number, value_text
from .state import EosState


class EosExposure:
    """The exposure settings behind an `EosState`, whose events must be fresh.

    Parameters
    ----------
    state
        State that the camera has reported.
    settings
        The rig file's keys for the camera.
    isos
        Native sensitivities.
    has_bulb
        Whether the PC can end an exposure.
    """

    def __init__(
        self,
        state: EosState,
        settings: PtpCameraSettings,
        isos: Collection[int],
        *,
        has_bulb: bool,
    ) -> None:
        self._state = state
        self._settings = settings
        self._isos = isos
        self._has_bulb = has_bulb
        self._bulb_s: float | None = None

    @property
    def at_bulb(self) -> bool:
        """Whether the PC ends the next exposure."""
        return self._shutter() == BULB_TV

    def capabilities(self) -> CameraCapabilities:
        """Return the camera's own lists, less what the rig file excludes, plus bulb if it needs it.

        Raises
        ------
        DeviceError
            The camera offers no settings, for its dial is not at M, or none that the rig file
            allows.
        """
        self._require_manual()
        dial_s = sorted(t for c in self._shutter_codes() if (t := shutter_time_s(c)))
        exposures_s = (*dial_s, *self._bulb_times_s())
        isos = sorted(ISOS[code] for code in self._iso_codes())
        f_numbers = {F_NUMBERS[c] for c in self._aperture_codes()}
        if not exposures_s or not isos:
            missing = "isos" if exposures_s else "shutter times up to longest_exposure"
            raise DeviceError(
                f"the camera offers none of the rig file's {missing}: turn its dial to M, "
                "or correct the rig file"
            )
        return CameraCapabilities(
            exposures_s=exposures_s,
            isos=tuple(isos),
            f_numbers=tuple(sorted(f_numbers)),
            overhead_s=self._settings.frame_time,
            change_s=self._settings.change_time,
            settling_s=min(FIRST_BACK_OFF_S, self._settings.frame_time),
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
        self._require_manual()
        bulb_s = self._bulb_time_s(requested.exposure_s)
        codes = self._codes_of(requested, None if bulb_s is None else BULB_TV)
        self._bulb_s = bulb_s
        for prop, code in codes.items():
            self._state.set(prop, number(code))
        for prop, code in codes.items():
            if (reported := self._state.value(prop)) != code:
                raise DeviceError(
                    f"asked the camera for {requested}, it has changed its {_name_of(prop)} to "
                    f"{value_text(prop, number(reported or 0))} since: turn its dial to M and try "
                    "again"
                )

    def in_force(self) -> ExposureSettings:
        """Return the reported settings, with the actual shutter time; at bulb the nominal one.

        Raises
        ------
        DeviceError
            The camera is at bulb unasked, at automatic ISO, at something unknown, or its dial not
            at M.
        """
        self._require_manual()
        tv = self._shutter()
        iso, av = (self._state.value(prop) for prop in (Property.iso, Property.aperture))
        exposure_s = None if tv is None else shutter_time_s(tv)
        if tv == BULB_TV:
            exposure_s = self._bulb_s
        if exposure_s is None:
            raise _unusable(Property.shutter_time, tv)
        if iso is None or iso not in ISOS:
            raise _unusable(Property.iso, iso)
        f_number = None if av is None else F_NUMBERS.get(av)
        return ExposureSettings(exposure_s, ISOS[iso], f_number)

    def _codes_of(self, requested: ExposureSettings, bulb: int | None) -> dict[Property, int]:
        shutter = bulb or shutter_code(requested.exposure_s, self._shutter_codes())
        iso = iso_code(requested.iso, self._iso_codes())
        if shutter is None or iso is None:
            missing = "shutter time" if shutter is None else "ISO"
            dial = "B" if shutter is None and requested.exposure_s >= MIN_BULB_S else "M"
            raise DeviceError(
                f"asked the camera for {requested}, and it does not offer this {missing}: choose "
                f"one of those that 'labrig rig check' shows, or turn its dial to {dial}"
            )
        # a dial at B leaves no shutter time to be set
        codes = {} if self._dial_is_at_b else {Property.shutter_time: shutter}
        codes[Property.iso] = iso
        if requested.f_number is not None:
            aperture = aperture_code(requested.f_number, self._aperture_codes())
            if aperture is None:
                offered = [f"f/{F_NUMBERS[c]:g}" for c in self._aperture_codes()]
                raise DeviceError(
                    f"asked the camera for {requested}, "
                    + (
                        f"its lens offers {', '.join(offered)}: choose one of these"
                        if offered
                        else "it cannot set the aperture of its lens: set it by hand and leave "
                        "f_number out"
                    )
                )
            codes[Property.aperture] = aperture
        return codes

    @property
    def _dial_is_at_b(self) -> bool:
        return self._state.value(Property.exposure_mode) == BULB_EXPOSURE

    def _shutter(self) -> int | None:
        return BULB_TV if self._dial_is_at_b else self._state.value(Property.shutter_time)

    def _shutter_codes(self) -> tuple[int, ...]:
        """Return the codes of times that the camera itself counts."""
        allowed = self._settings.allows_exposure
        return tuple(
            code
            for code in self._state.choices(Property.shutter_time)
            if (time_s := shutter_time_s(code)) is not None
            and allowed(time_s)
            and not self._dial_is_at_b
        )

    def _bulb_times_s(self) -> tuple[float, ...]:
        at_m = BULB_TV in self._state.choices(Property.shutter_time)
        possible = self._has_bulb and (at_m or self._dial_is_at_b)
        return self._settings.bulb_times_s if possible else ()

    def _bulb_time_s(self, exposure_s: float) -> float | None:
        """Return the time offered at bulb that `exposure_s` stands for."""
        if not exposure_s > 0:
            raise DeviceError(
                f"expected a shutter time longer than 0 s, asked for {exposure_s} s: "
                "correct the protocol"
            )
        for time_s in self._bulb_times_s():
            if abs(math.log2(time_s / exposure_s)) <= SAME_SHUTTER_STOPS:
                return time_s
        return None

    def _iso_codes(self) -> tuple[int, ...]:
        return tuple(c for c in self._state.choices(Property.iso) if ISOS.get(c) in self._isos)

    def _aperture_codes(self) -> tuple[int, ...]:
        return tuple(c for c in self._state.choices(Property.aperture) if c in F_NUMBERS)

    def _require_manual(self) -> None:
        mode = self._state.value(Property.exposure_mode)
        if mode not in (None, MANUAL_EXPOSURE) and not (
            self._dial_is_at_b and self._bulb_times_s()
        ):
            raise DeviceError(
                f"expected the camera's dial at M (exposure mode {MANUAL_EXPOSURE}), it says "
                f"{mode}: turn the dial to M"
            )


def _name_of(prop: Property) -> str:
    return prop.name.replace("_", " ")


def _unusable(prop: Property, value: int | None) -> DeviceError:
    reported = "nothing" if value is None else value_text(prop, number(value))
    return DeviceError(
        f"expected a {_name_of(prop)} that can be reduced, the camera says {reported}: "
        "turn its dial to M, neither bulb nor automatic ISO"
    )
