"""Checks of the settings of a camera without a maker's extension that would spoil photometry.

Values of properties: PIMA 15740, 13.5. Settings that the standard does not cover are unknown.
"""

import math
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass

from labrig.acquire import Finding, Severity

from ..codes import Standard, StandardEvent, StandardProperty
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..settings import PtpCameraSettings
from .exposure import AUTO_ISO, MIN_UNITS, UNITS_PER_S
from .object_info import can_be_raw
from .properties import PropertyDescription, StandardProperties

MANUAL_PROGRAM = 1
#: A time told true lies so near to a power of two in thirds or halves of a stop, but for rounding;
#: those of a dial, such as 1/60 s for 1/64 s, are up to 6.7 % off.
TRUE_TIME = 0.014
_STEPS_PER_STOP = (2, 3)


@dataclass(frozen=True)
class _Need:
    """A property, the value that it needs, and the effect of another value.

    Attributes
    ----------
    fine
        Name of the needed value.
    spoils
        Effect of another value.
    remedy
        Remedy for the user.
    severity
        Severity of another value.
    """

    prop: StandardProperty
    value: int
    fine: str
    spoils: str
    remedy: str
    severity: Severity = "refuse"


_NEEDS = (
    _Need(
        StandardProperty.exposure_program,
        MANUAL_PROGRAM,
        "manual exposure",
        "the camera chooses exposures",
        "turn its dial to M",
    ),
    _Need(
        StandardProperty.focus_mode,
        1,
        "manual focus",
        "autofocus is on: it delays frames and finds nothing in the dark",
        "set the switch on lens or body to MF",
    ),
    _Need(
        StandardProperty.still_capture_mode,
        1,
        "single shots",
        "a release takes more than one frame, or takes it late",
        "set its drive mode to single",
    ),
    _Need(
        StandardProperty.capture_delay,
        0,
        "no self-timer",
        "its self-timer delays frames",
        "switch the self-timer off",
    ),
    _Need(
        StandardProperty.burst_number,
        1,
        "one frame a release",
        "a release takes a burst",
        "set its drive mode to single",
    ),
    _Need(
        StandardProperty.flash_mode,
        2,
        "flash off",
        "its flash is not off",
        "fold it down, switch it off",
        "warn",
    ),
)


def prepare(properties: StandardProperties) -> None:
    """Set the needed values, as far as the camera allows it; `findings` reports the rest.

    Raises
    ------
    DeviceError
        The camera does not answer.
    """
    for need in _NEEDS:
        described = properties.describe(need.prop)
        if described is not None and need.value in described.settable_to([need.value]):
            # one that lists a value and refuses it is found out by what it says afterwards
            with suppress(RefusedError):
                properties.set(need.prop, described, need.value)


def findings(
    properties: StandardProperties, info: DeviceInfo, settings: PtpCameraSettings
) -> list[Finding]:
    """Return all findings on the camera's settings, by asking the camera.

    Raises
    ------
    DeviceError
        The camera does not answer.
    """
    return [
        *_needs(properties),
        *_iso(properties.describe(StandardProperty.exposure_index), settings, info.model),
        *_shutter(properties.describe(StandardProperty.exposure_time)),
        _formats(info.capture_formats),
        *_card(info),
        Finding(
            "warn",
            "exposures are timed by its answer to InitiateCapture; from there to the open shutter "
            f"it is {_lag(settings.shutter_lag)}",
            "measure shutter_lag, and let decays be long against its scatter",
        ),
        Finding(
            "warn",
            "PTP has no word for automatic switching-off, noise reduction and tone settings",
            "switch all of them off in its menus",
        ),
    ]


def _needs(properties: StandardProperties) -> Iterator[Finding]:
    untold = []
    for need in _NEEDS:
        described = properties.describe(need.prop)
        if described is None:
            untold.append(need.fine)
        elif described.value != need.value:
            reported = f"{need.prop} = 0x{described.value:X}"
            yield Finding(need.severity, f"{need.spoils} ({reported})", need.remedy)
        else:
            yield Finding("fine", need.fine)
    if untold:
        yield Finding(
            "warn", f"the camera does not report whether it is set to {', '.join(untold)}", "look"
        )


def _iso(
    described: PropertyDescription | None, settings: PtpCameraSettings, model: str
) -> Iterator[Finding]:
    native = settings.native_isos(model)
    listed = ", ".join(map(str, native.values))
    if described is None and len(native.values) == 1:
        yield Finding(
            "warn", f"the camera does not report its ISO; the rig file says {listed}", "look at it"
        )
    elif described is None:
        yield Finding(
            "refuse",
            "the camera does not report its ISO",
            "set it by hand, and write that one alone into the rig file's 'isos'",
        )
    elif described.value == AUTO_ISO:
        yield Finding(
            "refuse", "automatic ISO is on: gain may change between frames", "set a fixed ISO"
        )
    else:
        yield Finding("fine", f"ISO {described.value}")
    if native.source == "assumed":
        yield Finding(
            "warn",
            f"which ISOs of a {model or 'camera without a name'} are native is not known: {listed} "
            "is assumed",
            "write the ISOs that you know into the camera's 'isos' in the rig file",
        )


def _shutter(described: PropertyDescription | None) -> Iterator[Finding]:
    if described is None:
        yield Finding("refuse", "the camera does not report its shutter time", "use another camera")
        return
    listed = [units for units in described.settable_to(()) if units >= MIN_UNITS]
    if not described.is_settable:
        yield Finding(
            "warn", "its shutter time cannot be set over PTP", "set it by hand, turn its dial to M"
        )
    if any(_off_true(units / UNITS_PER_S) > TRUE_TIME + 0.5 / units for units in listed):
        yield Finding(
            "warn",
            "its shutter times are those of a dial, such as 1/60 s for 1/64 s: true ones may "
            "differ by 7 %",
            "take frames that are compared with each other at one shutter time",
        )
    yield Finding(
        "fine",
        f"shutter times below {MIN_UNITS / UNITS_PER_S * 1e3:g} ms stay unused (0.1 ms steps)",
    )


def _off_true(time_s: float) -> float:
    """Return the deviation from the nearest time of a shutter of whole, half or third stops."""
    stops = math.log2(time_s)
    off_stops = min(abs(stops - round(stops * steps) / steps) for steps in _STEPS_PER_STOP)
    return math.expm1(off_stops * math.log(2.0))


def _formats(formats: Collection[int]) -> Finding:
    remedy = "set its image quality to RAW alone"
    listed = ", ".join(f"0x{code:04X}" for code in sorted(formats))
    if formats and not any(can_be_raw(code) for code in formats):
        return Finding("refuse", f"it photographs in no RAW format (it lists {listed})", remedy)
    return Finding(
        "warn", "PTP does not report whether it is set to RAW; the first frame will", remedy
    )


def _card(info: DeviceInfo) -> Iterator[Finding]:
    if StandardEvent.ObjectAdded not in info.events:
        yield Finding(
            "refuse",
            "it does not report its frames (no event ObjectAdded 0x4002)",
            "use another camera",
        )
    if Standard.DeleteObject not in info.operations:
        yield Finding(
            "warn", "its frames cannot be deleted from its card", "use an empty, large card"
        )


def _lag(shutter_lag_s: float) -> str:
    return f"{shutter_lag_s * 1e3:g} ms by the rig file" if shutter_lag_s else "not known"
