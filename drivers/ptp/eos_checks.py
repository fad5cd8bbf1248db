"""What of an EOS's own settings would spoil photometry, and where its menu has them.

Menus are named as a 5D Mark II shows them. Sources of codes: libgphoto2's ptp.h and config.c
(exposure and focus modes, automatic switching-off in seconds); custom functions: `eos_custom`.
"""

from collections.abc import Collection, Iterator

from labrig.acquire.findings import Finding

from .eos_codes import ISOS
from .eos_custom import CustomFunction
from .eos_protocol import MANUAL_EXPOSURE, Eos, Property
from .eos_state import EosState

MANUAL_FOCUS = 3
AUTO_ISO = 0
#: Values that stand for "never"; models with signed seconds write −1.
NEVER_OFF = (0, 0xFFFFFFFF)
#: Canon's sensors amplify in whole stops; thirds and what lies outside are computed afterwards.
NATIVE_ISOS = (100, 200, 400, 800, 1600, 3200, 6400)

_DIAL = {0: "P", 1: "Tv", 2: "Av", 4: "B", 7: "C1", 9: "the green square", 16: "C2", 17: "C3"}
_BY_HAND = "look for yourself in the camera's menu"


def findings(state: EosState, isos: Collection[int], operations: Collection[int]) -> list[Finding]:
    """All that can be told; the state's events must be fresh.

    Parameters
    ----------
    isos
        Sensitivities that the rig file allows.
    operations
        Codes of what the camera can do.
    """
    return [
        _exposure_mode(state.value(Property.exposure_mode)),
        _focus(state.value(Property.focus_mode)),
        _iso_in_force(state.value(Property.iso)),
        *_rig_isos(isos),
        _auto_power_off(state.value(Property.auto_power_off), Eos.KeepDeviceOn in operations),
        *_custom_functions(state),
    ]


def _exposure_mode(mode: int | None) -> Finding:
    if mode is None:
        return Finding("warn", "the camera does not tell its exposure mode", "turn its dial to M")
    if mode != MANUAL_EXPOSURE:
        at = _DIAL.get(mode, f"mode {mode}")
        return Finding("refuse", f"its dial is at {at}: it chooses exposures", "turn it to M")
    return Finding("fine", "dial at M")


def _focus(mode: int | None) -> Finding:
    if mode is None:
        return Finding("warn", "the camera does not tell its focus mode", "set its lens to MF")
    if mode != MANUAL_FOCUS:
        return Finding(
            "refuse",
            "autofocus is on: it delays frames and finds nothing in the dark",
            "set the switch on the lens to MF",
        )
    return Finding("fine", "focus at MF")


def _iso_in_force(code: int | None) -> Finding:
    where = "ISO button above the display, a whole stop from 100 to 6400"
    if code is None:
        return Finding("warn", "the camera does not tell its ISO", where)
    if code == AUTO_ISO:
        return Finding("refuse", "automatic ISO is on: gain may change between frames", where)
    if ISOS.get(code) not in NATIVE_ISOS:
        said = f"ISO {ISOS[code]}" if code in ISOS else f"the ISO code 0x{code:X}"
        return Finding("refuse", f"{said} is not native: computed after digitising", where)
    return Finding("fine", f"ISO {ISOS[code]} is native")


def _rig_isos(isos: Collection[int]) -> Iterator[Finding]:
    if others := sorted(set(isos) - set(NATIVE_ISOS)):
        yield Finding(
            "refuse",
            f"the rig file allows ISO {', '.join(map(str, others))}, which "
            f"{'is' if len(others) == 1 else 'are'} not native: computed after digitising",
            "leave it out of the camera's 'isos'",
        )


def _auto_power_off(after_s: int | None, can_be_kept_on: bool) -> Finding:
    where = "Set-up 1 (yellow) → Auto power off → Off"
    if after_s is None:
        return Finding(
            "warn", "the camera does not tell when it switches itself off", f"{_BY_HAND}: {where}"
        )
    if after_s in NEVER_OFF:
        return Finding("fine", "auto power off is off")
    what = f"it switches itself off after {after_s} s"
    if can_be_kept_on:
        return Finding("warn", f"{what}; labrig keeps it awake while a run goes on", where)
    return Finding("refuse", f"{what} and cannot be kept awake over USB", where)


def _custom_functions(state: EosState) -> Iterator[Finding]:
    for function, words, spoils, where in (
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
            yield Finding("warn", f"could not read {words}", f"{_BY_HAND}: {where}")
        elif value:
            yield Finding("refuse", f"{words} is on: {spoils}", where)
        else:
            yield Finding("fine", f"{words} is off")
    if state.custom_functions.value(CustomFunction.iso_expansion):
        yield Finding(
            "warn",
            "ISO expansion is on: the camera offers L and H, which are not native",
            "C.Fn I (Exposure) → 3 ISO expansion → 0: Off",
        )
