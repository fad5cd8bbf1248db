"""Shutter time, aperture and sensitivity of an EOS: what it offers, what is set, setting it."""

from labrig.acquire.values import CameraOffers, ExposureSettings
from labrig.errors import DeviceError

from .eos_codes import (
    F_NUMBERS,
    ISOS,
    aperture_code,
    iso_code,
    shutter_code,
    shutter_time_s,
)
from .eos_protocol import MANUAL_EXPOSURE, Property, number, value_text
from .eos_state import EosState
from .settings import PtpCameraSettings


class EosExposure:
    """The exposure settings behind an `EosState`; that one's events must be fresh."""

    def __init__(self, state: EosState, settings: PtpCameraSettings) -> None:
        self._state = state
        self._settings = settings

    def offers(self) -> CameraOffers:
        """The camera's own lists, less what the rig file excludes.

        Raises
        ------
        DeviceError
            The camera lets none be set, for its dial is not at M, or none that the rig file allows.
        """
        self._require_manual()
        exposures_s = sorted(t for c in self._shutter_codes() if (t := shutter_time_s(c)))
        isos = sorted(ISOS[code] for code in self._iso_codes())
        f_numbers = {F_NUMBERS[c] for c in self._aperture_codes()}
        if not exposures_s or not isos:
            missing = "isos" if exposures_s else "shutter times up to longest_exposure"
            raise DeviceError(
                f"the camera offers none of the rig file's {missing}: turn its dial to M, "
                "or correct the rig file"
            )
        return CameraOffers(
            exposures_s=tuple(exposures_s),
            isos=tuple(isos),
            f_numbers=tuple(sorted(f_numbers)),
            overhead_s=self._settings.frame_time,
            frame_bytes=round(self._settings.frame_size),
        )

    def apply(self, wanted: ExposureSettings) -> None:
        """Set what is not in force already, read back.

        Raises
        ------
        DeviceError
            The camera does not offer it or did not take it.
        """
        self._require_manual()
        codes = self._codes_of(wanted)
        for prop, code in codes.items():
            self._state.set(prop, number(code))
        for prop, code in codes.items():
            if (said := self._state.value(prop)) != code:
                raise DeviceError(
                    f"asked the camera for {wanted}, it has changed its {_words(prop)} to "
                    f"{value_text(prop, number(said or 0))} since: turn its dial to M and try again"
                )

    def in_force(self) -> ExposureSettings:
        """What the camera says is set, with the true shutter time.

        Raises
        ------
        DeviceError
            It is at bulb, at automatic ISO, at something unknown, or its dial not at M.
        """
        self._require_manual()
        tv, iso, av = (
            self._state.value(prop)
            for prop in (Property.shutter_time, Property.iso, Property.aperture)
        )
        exposure_s = None if tv is None else shutter_time_s(tv)
        if exposure_s is None:
            raise _unusable(Property.shutter_time, tv)
        if iso is None or iso not in ISOS:
            raise _unusable(Property.iso, iso)
        f_number = None if av is None else F_NUMBERS.get(av)
        return ExposureSettings(exposure_s, ISOS[iso], f_number)

    def _codes_of(self, wanted: ExposureSettings) -> dict[Property, int]:
        if not wanted.exposure_s > 0:
            raise DeviceError(
                f"expected a shutter time longer than 0 s, asked for {wanted.exposure_s} s: "
                "correct the protocol"
            )
        shutter = shutter_code(wanted.exposure_s, self._shutter_codes())
        iso = iso_code(wanted.iso, self._iso_codes())
        if shutter is None or iso is None:
            what = "shutter time" if shutter is None else "ISO"
            raise DeviceError(
                f"asked the camera for {wanted}, it does not offer this {what}: choose from what "
                "'labrig rig check' shows, or turn its dial to M"
            )
        codes = {Property.shutter_time: shutter, Property.iso: iso}
        if wanted.f_number is not None:
            aperture = aperture_code(wanted.f_number, self._aperture_codes())
            if aperture is None:
                offered = [f"f/{F_NUMBERS[c]:g}" for c in self._aperture_codes()]
                raise DeviceError(
                    f"asked the camera for {wanted}, "
                    + (
                        f"its lens offers {', '.join(offered)}: choose one of these"
                        if offered
                        else "it cannot set the aperture of its lens: set it by hand and leave "
                        "f_number out"
                    )
                )
            codes[Property.aperture] = aperture
        return codes

    def _shutter_codes(self) -> tuple[int, ...]:
        allowed = self._settings.allows_exposure
        return tuple(
            code
            for code in self._state.choices(Property.shutter_time)
            if (time_s := shutter_time_s(code)) is not None and allowed(time_s)
        )

    def _iso_codes(self) -> tuple[int, ...]:
        native = self._settings.isos
        return tuple(c for c in self._state.choices(Property.iso) if ISOS.get(c) in native)

    def _aperture_codes(self) -> tuple[int, ...]:
        return tuple(c for c in self._state.choices(Property.aperture) if c in F_NUMBERS)

    def _require_manual(self) -> None:
        mode = self._state.value(Property.exposure_mode)
        if mode not in (None, MANUAL_EXPOSURE):
            raise DeviceError(
                f"expected the camera's dial at M (exposure mode {MANUAL_EXPOSURE}), it says "
                f"{mode}: turn the dial to M"
            )


def _words(prop: Property) -> str:
    return prop.name.replace("_", " ")


def _unusable(prop: Property, value: int | None) -> DeviceError:
    said = "nothing" if value is None else value_text(prop, number(value))
    return DeviceError(
        f"expected a {_words(prop)} that can be reduced, the camera says {said}: "
        "turn its dial to M, neither bulb nor automatic ISO"
    )
