"""Checks of an EOS's own settings that would spoil photometry, and their places in its menu.

Menus are named as on a 5D Mark II. Sources of codes: libgphoto2's ptp.h and config.c (exposure and
focus modes, automatic switching-off in seconds); of custom functions: `custom_functions`.
"""

from collections.abc import Iterable, Iterator

from labrig.acquire import Finding

from ..device_info import DeviceInfo
from ..settings import PtpCameraSettings
from .codes import BULB_TV, ISOS
from .custom_functions import CustomFunction
from .iso import NativeIsos, isos_of_model
from .protocol import BULB_EXPOSURE, MANUAL_EXPOSURE, Property
from .state import EosState

MANUAL_FOCUS = 3
AUTO_ISO = 0
#: Values that stand for "never"; models with signed seconds write −1.
NEVER_OFF = (0, 0xFFFFFFFF)

_DIAL = {0: "P", 1: "Tv", 2: "Av", 4: "B", 7: "C1", 9: "the green square", 16: "C2", 17: "C3"}
_BY_HAND = "look for yourself in the camera's menu"


def findings(
    state: EosState, settings: PtpCameraSettings, info: DeviceInfo, *, has_bulb: bool
) -> list[Finding]:
    """Return all findings on the camera's settings; the state's events must be fresh.

    Parameters
    ----------
    settings
        The rig file's keys for this camera.
    info
        Model and abilities of the camera.
    has_bulb
        Whether the PC can end an exposure.
    """
    isos = settings.native_isos(info.model)
    return [
        *_exposure_mode(state, wants_bulb=bool(settings.bulb_times_s), has_bulb=has_bulb),
        _focus(state.value(Property.focus_mode)),
        _iso_in_force(state.value(Property.iso), isos),
        *_native_isos(isos, info.model),
        _auto_power_off(state.value(Property.auto_power_off)),
        *_custom_functions(state),
    ]


def _exposure_mode(state: EosState, *, wants_bulb: bool, has_bulb: bool) -> Iterator[Finding]:
    mode = state.value(Property.exposure_mode)
    if mode == BULB_EXPOSURE and wants_bulb and has_bulb:
        yield Finding(
            "warn", "dial at B: exposures of 64 s and more only", "turn it to M for others"
        )
        return
    if mode is None:
        yield Finding("warn", "the camera does not report its exposure mode", "turn its dial to M")
    elif mode != MANUAL_EXPOSURE:
        at = _DIAL.get(mode, f"mode {mode}")
        yield Finding("refuse", f"its dial is at {at}: it chooses exposures", "turn it to M")
    else:
        yield Finding("fine", "dial at M")
    if wants_bulb and not (has_bulb and BULB_TV in state.choices(Property.shutter_time)):
        yield Finding(
            "warn",
            "the rig file's longest_exposure asks for bulb, which the camera does not offer at M",
            "turn its dial to B, if it has one, or set longest_exposure to 32 s",
        )


def _focus(mode: int | None) -> Finding:
    if mode is None:
        return Finding("warn", "the camera does not report its focus mode", "set its lens to MF")
    if mode != MANUAL_FOCUS:
        return Finding(
            "refuse",
            "autofocus is on: it delays frames and finds nothing in the dark",
            "set the switch on the lens to MF",
        )
    return Finding("fine", "focus at MF")


def _iso_in_force(code: int | None, native: NativeIsos) -> Finding:
    where = f"ISO button above the display, one of {_listed(native.values)}"
    if code is None:
        return Finding("warn", "the camera does not report its ISO", where)
    if code == AUTO_ISO:
        return Finding("refuse", "automatic ISO is on: gain may change between frames", where)
    if ISOS.get(code) not in native.values:
        name = f"ISO {ISOS[code]}" if code in ISOS else f"the ISO code 0x{code:X}"
        return Finding("refuse", f"{name} is not native: computed after digitising", where)
    return Finding("fine", f"ISO {ISOS[code]} is native")


def _native_isos(native: NativeIsos, model: str) -> Iterator[Finding]:
    """Return a finding on the source of the native ISOs, where it leaves a doubt."""
    listed = _listed(native.values)
    if native.source == "assumed":
        yield Finding(
            "warn",
            f"which ISOs of a {model or 'camera without a name'} are native is not known: {listed} "
            "is assumed",
            "write the ISOs that you know into the camera's 'isos' in the rig file",
        )
    model_isos = isos_of_model(model)
    foreign = sorted(set(native.values) - set(model_isos.values))
    if native.source == "rig file" and foreign:
        doubt = "is not known to be native" if model_isos.source == "assumed" else "is not native"
        yield Finding(
            "warn",
            f"the rig file allows ISO {_listed(foreign)}, which {doubt} in a {model}: computed "
            "after digitising",
            "leave it out of the camera's 'isos' unless you have measured it",
        )


def _listed(isos: Iterable[int]) -> str:
    return ", ".join(map(str, isos))


def _auto_power_off(after_s: int | None) -> Finding:
    """Return a finding on automatic switching-off, a second precaution beside keeping awake."""
    where = "Set-up 1 (yellow) → Auto power off → Off"
    if after_s is None:
        return Finding(
            "warn", "the camera does not report when it switches itself off", f"{_BY_HAND}: {where}"
        )
    if after_s in NEVER_OFF:
        return Finding("fine", "auto power off is off")
    return Finding("refuse", f"it switches itself off when left alone for {after_s} s", where)


def _custom_functions(state: EosState) -> Iterator[Finding]:
    for function, name, spoils, where in (
        (
            CustomFunction.long_exposure_noise_reduction,
            "long-exposure noise reduction",
            "it subtracts a dark frame of its own and doubles the time of a frame",
            "C.Fn II (Image) → 1 Long exp. noise reduction → 0: Off",
        ),
        (
            CustomFunction.highlight_tone_priority,
            "highlight tone priority",
            "it halves the gain without saying so",
            "C.Fn II (Image) → 3 Highlight tone priority → 0: Disable",
        ),
        (
            CustomFunction.mirror_lock_up,
            "mirror lock-up",
            "the first press takes no photograph",
            "C.Fn III (Autofocus/Drive) → 6 Mirror lockup → 0: Disable",
        ),
    ):
        value = state.custom_functions.value(function)
        if value is None:
            yield Finding("warn", f"could not read {name}", f"{_BY_HAND}: {where}")
        elif value:
            yield Finding("refuse", f"{name} is on: {spoils}", where)
        else:
            yield Finding("fine", f"{name} is off")
    if state.custom_functions.value(CustomFunction.iso_expansion):
        yield Finding(
            "warn",
            "ISO expansion is on: the camera offers L and H, which are not native",
            "C.Fn I (Exposure) → 3 ISO expansion → 0: Off",
        )
