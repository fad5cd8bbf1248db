"""What is known of a run besides what it measured: for its report and for exports."""

from dataclasses import dataclass

from labrig.record.history import Interruption


@dataclass(frozen=True)
class DeviceLine:
    """A device of the rig: its role, the address it was reached at, and who answered there."""

    role: str
    address: str
    identity: str


@dataclass(frozen=True, kw_only=True)
class RunDescription:
    """A run, its bench and what its result was made with.

    Attributes
    ----------
    title
        The sample's name.
    protocol
        Name of the protocol.
    run
        Name of the run folder.
    started, ended
        As they are to be read.
    rig
        Name of the rig.
    simulated
        Whether the rig is a simulated one.
    labrig_version, libraries
        Of the processing; libraries by name and version.
    sample
        Pairs of what and value: thickness, batch, …
    devices
        Of the rig.
    guard
        What would have switched the lights off, had labrig died.
    protocol_text, rig_text
        The files, as resolved.
    interruptions
        Attempts that failed, by time.
    notes
        What a person had to say afterwards.
    """

    title: str
    protocol: str
    run: str
    started: str
    ended: str
    rig: str
    simulated: bool
    labrig_version: str
    libraries: tuple[tuple[str, str], ...] = ()
    sample: tuple[tuple[str, str], ...] = ()
    devices: tuple[DeviceLine, ...] = ()
    guard: str = ""
    protocol_text: str = ""
    rig_text: str = ""
    interruptions: tuple[Interruption, ...] = ()
    notes: str = ""
