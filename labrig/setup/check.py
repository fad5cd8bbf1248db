"""Check of a rig: identity, settings and exercise of its devices."""

import io
import logging
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

from labrig.acquire import (
    ROLES,
    Checkable,
    Device,
    ExerciseContext,
    Exercised,
    Finding,
    Frame,
    Measured,
    Rig,
    Suggestion,
)
from labrig.bench import Bench
from labrig.foundation.activity import counted
from labrig.foundation.errors import DeviceError, LabrigError
from labrig.record import size_text
from labrig.reduce import FrameMeasurement, measure, read_raw
from labrig.setup.picture_stats import decode

#: Mean above black, as a fraction of the range, from which a frame is not dark.
LIGHT = 0.005
#: EXIF orientation of a picture without rotation.
UPRIGHT = 1


class Photographs:
    """Reader of RAW frames and live pictures in a rig check."""

    def dark_frame(self, frame: Frame) -> Exercised:
        """Return noise and size of a dark frame, and whether it is dark and not rotated."""
        reduced = measure(read_raw(frame.data, "the dark frame"))
        return Exercised(
            tuple(_noise(reduced, frame)),
            (_darkness(reduced), *_black(reduced), _orientation(frame.data)),
            (
                Suggestion("frame_pixels", f"[{reduced.width}, {reduced.height}]"),
                Suggestion("frame_size", size_text(len(frame.data))),
            ),
        )

    def live_picture(self, jpeg: bytes) -> Measured:
        """Return the size of a live picture."""
        height, width, _ = decode(jpeg).shape
        return Measured("live picture", f"{width} x {height} pixels, {len(jpeg) / 1e3:.1f} kB")


def _noise(reduced: FrameMeasurement, frame: Frame) -> list[Measured]:
    return [
        Measured(
            f"dark frame {frame.settings}, {name}",
            f"mean {stats.mean:.2f} ± {stats.sigma:.3f} DN above black, std {stats.std:.2f} DN, "
            f"{stats.hot} hot, {stats.saturated} clipped of {stats.n}",
        )
        for name, stats in reduced.channels.items()
    ]


def _darkness(reduced: FrameMeasurement) -> Finding:
    limit_dn = LIGHT * (reduced.white - min(reduced.black))
    brightest_dn = max(stats.mean for stats in reduced.channels.values())
    if brightest_dn > limit_dn:
        return Finding(
            "warn",
            f"with the lamp off a frame is not dark ({brightest_dn:.0f} DN above black)",
            "darken the room, cover displays, and let the samples fade",
        )
    return Finding("fine", "with the lamp off a frame is dark")


def _black(reduced: FrameMeasurement) -> Iterator[Finding]:
    """Yield that the camera cuts off noise below black; nothing of one that keeps it."""
    read_dn = max(stats.read_dn or 0.0 for stats in reduced.channels.values())
    if read_dn:
        yield Finding(
            "warn",
            "the camera subtracts its black level and cuts off noise below it (read noise "
            f"{read_dn:.1f} DN); means are corrected for it",
            "raise its black level (offset) if it has such a setting; else expose faint glow for "
            "longer, so that little of it lies within the read noise",
        )


def _orientation(content: bytes) -> Finding:
    """Return whether auto rotate is off, from the EXIF; no known property reports it."""
    import exifread

    # it warns through logging of every odd tag
    logging.getLogger("exifread").setLevel(logging.CRITICAL)
    try:
        tags: dict[str, Any] = exifread.process_file(io.BytesIO(content), details=False)
    except MemoryError:
        raise
    except Exception:  # damaged EXIF fails in any way
        return Finding(
            "warn",
            "the frame's EXIF cannot be read, and so not whether it is turned",
            "see that auto rotate is off",
        )
    tag = tags.get("Image Orientation")
    if tag is None or list(tag.values) == [UPRIGHT]:
        return Finding("fine", "frames are not marked as turned")
    return Finding(
        "refuse",
        "auto rotate is on: it marks frames as turned, some this way and some that",
        "Set-up 1 (yellow) → Auto rotate → Off",
    )


@dataclass(frozen=True)
class DeviceReport:
    """Report on one device of a rig.

    Attributes
    ----------
    key
        Key of the device in the rig file.
    identity
        Maker, model, serial number and firmware that the device reported.
    findings
        Assessments of the device's settings.
    measured
        Quantities measured in the exercise.
    suggestions
        Values for the rig file.
    failure
        Reason why the device failed, in one line; None if it did not.
    """

    key: str
    identity: str
    findings: tuple[Finding, ...] = ()
    measured: tuple[Measured, ...] = ()
    suggestions: tuple[Suggestion, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class RigReport:
    """Report on all devices of a rig.

    Attributes
    ----------
    rig
        Name of the rig.
    devices
        Reports on the devices.
    unsafe
        Reason why the safe state is not confirmed; None if it is.
    """

    rig: str
    devices: tuple[DeviceReport, ...]
    unsafe: str | None = None

    @property
    def failures(self) -> tuple[str, ...]:
        """Failures of devices, one line each."""
        failed = [f"{d.key}: {d.failure}" for d in self.devices if d.failure is not None]
        return (*failed, *([self.unsafe] if self.unsafe else []))

    @property
    def refusals(self) -> tuple[str, ...]:
        """Settings that would spoil a measurement, one line each."""
        return tuple(
            f"{device.key}: {finding}"
            for device in self.devices
            for finding in device.findings
            if finding.severity == "refuse"
        )

    def rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Yield the rows of a table: device, assessment, subject, and value or remedy."""
        for device in self.devices:
            yield device.key, "", device.identity, ""
            for finding in device.findings:
                yield "", finding.severity, finding.what, finding.remedy
            for measured in device.measured:
                yield "", "", measured.what, measured.value
            for suggestion in device.suggestions:
                yield (
                    "",
                    "",
                    f"for the rig file, devices.{device.key}:",
                    f"{suggestion.key}: {suggestion.value}",
                )
            if device.failure is not None:
                yield "", "failed", device.failure, ""
        if self.unsafe is not None:
            yield "rig", "failed", self.unsafe, ""
        else:
            yield "rig", "fine", "left in its safe state", ""

    def to_json(self) -> dict[str, Any]:
        """Return the content of `labrig rig check --json`."""
        return asdict(self) | {"failures": list(self.failures), "refusals": list(self.refusals)}


def check_rig(bench: Bench) -> RigReport:
    """Identify and exercise every device of a rig, and bring the rig to its safe state.

    A device is exercised as its role defines, unless its settings would spoil photometry.

    Parameters
    ----------
    bench
        Bench whose devices are not open.

    Returns
    -------
    RigReport
        Identity, settings and measured times of every device.

    Raises
    ------
    DeviceError
        If a device cannot be opened; nothing was exercised then.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.setup import check_rig
    >>> rig_file = labrig.read_rig_file(Path("runs/decay/rig.yaml"))
    >>> with labrig.open_bench(rig_file, "rig.yaml") as bench:
    ...     report = check_rig(bench)
    >>> [device.key for device in report.devices]
    ['lamp', 'shield', 'door', 'camera', 'changer', 'thermometer']
    >>> report.failures, report.refusals
    ((), ())
    """
    report: RigReport | None = None
    try:
        with bench.devices() as rig:
            report = _checked_rig(rig)
    except DeviceError as error:
        if report is None:
            raise
        return replace(report, unsafe=str(error))
    return report


def _checked_rig(rig: Rig) -> RigReport:
    context = ExerciseContext(rig.clock, Photographs())
    return RigReport(
        rig.name,
        tuple(
            _checked(key, device, context)
            for key, device in counted(list(rig.devices.items()), "checking devices")
        ),
    )


def _checked(key: str, device: Device, context: ExerciseContext) -> DeviceReport:
    """Return the report on one device, up to the step where it failed."""
    report = DeviceReport(key, "did not answer")
    try:
        report = replace(report, identity=device.identity())
        if isinstance(device, Checkable):
            report = replace(report, findings=tuple(device.findings()))
        if any(finding.severity == "refuse" for finding in report.findings):
            return replace(
                report, measured=(Measured("not exercised", "correct first what is refused"),)
            )
        if exercise := ROLES[key].exercise:
            outcome = exercise(device, context)
            report = replace(
                report,
                measured=outcome.measured,
                findings=(*report.findings, *outcome.findings),
                suggestions=outcome.suggestions,
            )
    except MemoryError:
        raise
    except LabrigError as error:
        report = replace(report, failure=str(error))
    except Exception as error:  # a fault of a driver must not hide what the others do
        report = replace(report, failure=f"its driver failed ({error!r})")
    return report
