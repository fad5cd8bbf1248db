"""A rig's devices identified, looked over and exercised gently."""

from dataclasses import replace

from labrig.acquire import ROLES, Checkable, Device, Measured, Rig, Trial
from labrig.bench import Bench
from labrig.errors import DeviceError, LabrigError
from labrig.setup.photographs import Photographs
from labrig.setup.report import DeviceReport, RigReport


def check_rig(stand: Bench) -> RigReport:
    """Open the rig, look at every device, bring it to its safe state.

    Each device is exercised as its role says, unless its settings would spoil photometry.

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
    trial = Trial(rig.clock, Photographs())
    return RigReport(
        rig.name, tuple(_checked(key, device, trial) for key, device in rig.devices.items())
    )


def _checked(key: str, device: Device, trial: Trial) -> DeviceReport:
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
        if exercise := ROLES[key].exercise:
            taught = exercise(device, trial)
            report = replace(
                report,
                measured=taught.measured,
                findings=(*report.findings, *taught.findings),
                suggestions=taught.suggestions,
            )
    except LabrigError as error:
        report = replace(report, failure=str(error))
    except Exception as error:  # a fault of a driver must not hide what the others do
        report = replace(report, failure=f"its driver failed ({error!r})")
    return report
