"""A rig's devices identified, looked over and exercised gently."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from labrig.acquire import (
    Camera,
    Checkable,
    Device,
    Lamp,
    LampShield,
    LiveView,
    Rig,
    Thermometer,
    TrapDoor,
)
from labrig.bench import Bench
from labrig.clock import Clock
from labrig.errors import DeviceError, LabrigError
from labrig.quantity import duration_text
from labrig.setup.photographs import exercise_camera
from labrig.setup.picture_stats import decode
from labrig.setup.report import DeviceReport, Measured, RigReport, spread_ms

#: Often enough to see a slow line, seldom enough not to wear the relay.
SWITCHINGS = 3
#: Key of the device that only aims; a camera in its place takes no photographs.
VIEWFINDER = "viewfinder"


def check_rig(stand: Bench) -> RigReport:
    """Open the rig, look at every device, bring it to its safe state.

    The lamp is lit for some hundredths of a second, three times; trap door and shield go there and
    back once; the camera takes four frames; a viewfinder shows one picture; a thermometer is read
    once. A camera whose settings would spoil photometry takes none.

    Raises
    ------
    DeviceError
        A device could not be opened; nothing was exercised.
    """
    report: RigReport | None = None
    try:
        with stand.devices() as rig:
            report = _look_at(rig)
    except DeviceError as error:
        if report is None:
            raise
        return replace(report, unsafe=str(error))
    return report


def _look_at(rig: Rig) -> RigReport:
    return RigReport(
        rig.name,
        tuple(_checked(key, device, rig.clock) for key, device in rig.devices.items()),
    )


def _checked(key: str, device: Device, clock: Clock) -> DeviceReport:
    """Everything that can be told of one device, up to where it failed."""
    report = DeviceReport(key, "did not answer")
    try:
        report = replace(report, identity=device.identity())
        if isinstance(device, Checkable):
            report = replace(report, findings=tuple(device.findings()))
        if any(finding.severity == "refuse" for finding in report.findings):
            return replace(
                report, measured=(Measured("not exercised", "first mend what is refused"),)
            )
        if key == VIEWFINDER and isinstance(device, LiveView):
            report = replace(report, measured=_look_through(device, clock))
        elif isinstance(device, Lamp):
            report = replace(report, measured=_exercise_lamp(device, clock))
        elif isinstance(device, TrapDoor):
            ways = {"open, read back": device.open, "close, read back": device.close}
            report = replace(report, measured=_swing(ways, device.travel_s(), clock))
        elif isinstance(device, LampShield):
            ways = {"cover, read back": device.cover, "uncover, read back": device.uncover}
            report = replace(report, measured=_swing(ways, device.travel_s(), clock))
        elif isinstance(device, Camera):
            report = exercise_camera(report, device, clock)
        elif isinstance(device, Thermometer):
            report = replace(report, measured=_read(device, clock))
    except LabrigError as error:
        report = replace(report, failure=str(error))
    except Exception as error:  # a fault of a driver must not hide what the others do
        report = replace(report, failure=f"its driver failed ({error!r})")
    return report


def _exercise_lamp(lamp: Lamp, clock: Clock) -> tuple[Measured, ...]:
    on_s, off_s = [], []
    try:
        for _ in range(SWITCHINGS):
            on_s.append(_timed(lamp.on, clock))
            _require(lamp, on=True)
            off_s.append(_timed(lamp.off, clock))
            _require(lamp, on=False)
    finally:
        with clock.shielded():
            lamp.off()
    return (
        Measured("switch on, read back", spread_ms(on_s)),
        Measured("switch off, read back", spread_ms(off_s)),
    )


def _swing(
    ways: Mapping[str, Callable[[], None]], travel_s: float, clock: Clock
) -> tuple[Measured, ...]:
    """There and back, the full travel each; the last way is the safe one."""
    measured = []
    for what, go in ways.items():
        measured.append(Measured(what, f"{_timed(go, clock) * 1e3:.1f} ms"))
        clock.sleep(travel_s)
    return (
        *measured,
        Measured(
            "travel, from the rig file",
            f"{duration_text(travel_s)}; watch that it has stopped by then: no board sees that",
        ),
    )


def _look_through(viewfinder: LiveView, clock: Clock) -> tuple[Measured, ...]:
    asked_s = clock.now()
    jpeg = viewfinder.preview()
    shown_s = clock.now() - asked_s
    height, width, _ = decode(jpeg).shape
    return (
        Measured("live picture", f"{width} x {height} pixels, {len(jpeg) / 1e3:.1f} kB"),
        Measured("until it was shown", f"{shown_s * 1e3:.0f} ms"),
    )


def _read(thermometer: Thermometer, clock: Clock) -> tuple[Measured, ...]:
    asked_s = clock.now()
    celsius = thermometer.celsius()
    return (
        Measured("temperature", f"{celsius:.1f} °C"),
        Measured("until it was read", f"{(clock.now() - asked_s) * 1e3:.0f} ms"),
    )


def _require(lamp: Lamp, *, on: bool) -> None:
    if lamp.is_on() != on:
        state = "on" if on else "off"
        raise DeviceError(
            f"the lamp was switched {state}, it says otherwise; look at it, switch it off by hand "
            "and check the relay"
        )


def _timed(act: Callable[[], object], clock: Clock) -> float:
    asked_s = clock.now()
    act()
    return clock.now() - asked_s
