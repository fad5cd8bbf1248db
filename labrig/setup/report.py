"""What a rig check found out."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from labrig.acquire import Finding, Measured, Suggestion


@dataclass(frozen=True)
class DeviceReport:
    """One device of the rig.

    Attributes
    ----------
    failure
        What it could not do, in one line; None if it did all that was asked.
    """

    key: str
    identity: str
    findings: tuple[Finding, ...] = ()
    measured: tuple[Measured, ...] = ()
    suggestions: tuple[Suggestion, ...] = ()
    failure: str | None = None


@dataclass(frozen=True)
class RigReport:
    """All devices of a rig, and whether it was left in its safe state.

    Attributes
    ----------
    unsafe
        Why the safe state is not confirmed; None if it is.
    """

    rig: str
    devices: tuple[DeviceReport, ...]
    unsafe: str | None = None

    @property
    def failures(self) -> tuple[str, ...]:
        """What did not work, one line each."""
        failed = [f"{d.key}: {d.failure}" for d in self.devices if d.failure is not None]
        return (*failed, *([self.unsafe] if self.unsafe else []))

    @property
    def refusals(self) -> tuple[str, ...]:
        """What would spoil a measurement, one line each."""
        return tuple(
            f"{device.key}: {finding}"
            for device in self.devices
            for finding in device.findings
            if finding.severity == "refuse"
        )

    def rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Device, verdict, what, and what to do: the lines of a table."""
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
        """What `labrig rig check --json` prints."""
        return asdict(self) | {"failures": list(self.failures), "refusals": list(self.refusals)}
