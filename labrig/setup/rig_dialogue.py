"""The dialogue that makes a new rig file: devices, their keys, ends of servos, lags."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

from labrig.acquire import CAMERA, DOOR, LAMP, ROLES, SHIELD, ServoSwing
from labrig.bench import Bench, open_bench
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import did_you_mean, parse_yaml
from labrig.setup.check import RigReport, check_rig
from labrig.setup.new_rig import USUAL, Candidate, NewRig

#: Time for which the lamp is lit for a person to see.
LIT_S = 1.0
#: Steps of a servo's pulse by keys, and the pulses between which it is moved, in seconds.
STEPS_S = {"+": 10e-6, "-": -10e-6, ">": 100e-6, "<": -100e-6}
SHORTEST_S, LONGEST_S = 500e-6, 2500e-6
#: Travel that is measured by a person who presses a key is rounded up to this step in seconds.
TRAVEL_STEP_S = 0.05
ENTER = ("\r", "\n")
#: Word by which a person leaves out a device.
NONE = "none"


class Dialogue(Protocol):
    """The person at the terminal."""

    @property
    def is_person(self) -> bool:
        """True if a person answers, who can correct an answer."""

    def tell(self, text: str) -> None:
        """Show a text."""

    def ask(self, question: str, default: str) -> str:
        """Return an answer; the default if it is empty."""

    def confirm(self, question: str) -> bool:
        """Return whether the answer is yes, which is the default."""

    def key(self) -> str:
        """Wait for a key and return it."""


@dataclass(frozen=True)
class Unattended:
    """A person who is not there: defaults are taken, and keys are needed for nothing.

    Attributes
    ----------
    show
        Function that shows a text.
    """

    show: Callable[[str], None]
    is_person: ClassVar[bool] = False

    def tell(self, text: str) -> None:
        """Show a text."""
        self.show(text)

    def ask(self, question: str, default: str) -> str:
        """Return the default.

        Raises
        ------
        UsageError
            There is none.
        """
        if not default:
            raise UsageError(f"--yes: expected an answer by --set, got none to: {question.strip()}")
        return default

    def confirm(self, question: str) -> bool:
        """Return True."""
        return True

    def key(self) -> str:
        """Return Enter."""
        return ENTER[-1]


def choose_devices(
    rig: NewRig,
    connected: Sequence[Candidate],
    given: Mapping[str, Mapping[str, Any]],
    left_out: Collection[str],
    dialogue: Dialogue,
    source: str,
) -> NewRig:
    """Return the rig with devices chosen among those found, and all their keys.

    Parameters
    ----------
    rig
        Rig without devices.
    connected
        Devices that are connected.
    given
        Keys that are given beforehand, by the devices' keys; they are not asked for.
    left_out
        Keys of devices that the rig does not have.
    dialogue
        The person at the terminal.
    source
        Path of the rig file, for messages.

    Returns
    -------
    NewRig
        The rig with its devices, and those that were found and are not used.

    Raises
    ------
    UsageError
        A key that was given beforehand is invalid.

    Examples
    --------
    >>> from labrig.setup import NewRig, Unattended, choose_devices, simulated_candidates
    >>> room = {"devices": {"lamp": {"driver": "numato", "address": "COM3", "relay": 2}}}
    >>> connected, nobody = simulated_candidates(room), Unattended(print)
    >>> rig = choose_devices(NewRig("attic"), connected, {}, ["camera"], nobody, "rig.yaml")
    >>> rig.devices["lamp"]["relay"], rig.devices["lamp"]["warm_up"]
    (2, '15 min')
    """
    for role in (*given, *left_out):
        if role not in ROLES:
            raise UsageError(f"unknown device '{role}'; {did_you_mean(role, list(ROLES))}")
    used: list[Candidate] = []
    for role in ROLES:
        if role in left_out:
            continue
        fitting = [each for each in connected if each.role == role and each not in used]
        chosen = _chosen(role, fitting, given.get(role, {}), dialogue)
        if chosen is None:
            continue
        used.append(chosen)
        for hint in chosen.hints:
            dialogue.tell(f"  ! {hint}")
        keys = {**chosen.keys, **given.get(role, {})}
        rig = rig.with_device(role, keys, chosen.name)
        rig = _with_keys(rig, role, given.get(role, {}), dialogue, source)
    others = tuple(each for each in connected if each not in used and each.role not in left_out)
    return replace(rig, others=others)


def _chosen(
    role: str, fitting: Sequence[Candidate], given: Mapping[str, Any], dialogue: Dialogue
) -> Candidate | None:
    """Return the device for a role; None if the rig has none."""
    if "driver" in given and "address" in given:
        return Candidate(role, f"{given['driver']} at {given['address']}", given)
    noun = ROLES[role].name
    if "address" in given:
        fitting = [each for each in fitting if each.keys["address"] == given["address"]]
        if not fitting:
            raise UsageError(
                f"{role}.address: no {noun} was recognised at {given['address']}; name its driver, "
                f"too: --set {role}.driver=NAME ('labrig rig devices' shows the ports)"
            )
        return fitting[0]
    for each in fitting:
        if given or dialogue.confirm(f"{noun}: {each.name}. Use it?"):
            return each
    if fitting or role not in (LAMP.key, CAMERA.key):
        return None
    driver = dialogue.ask(f"{noun}: none was recognised. Name of its driver, or '{NONE}'", NONE)
    if driver == NONE:
        return None
    address = dialogue.ask(f"{noun}: its address, such as COM3 or /dev/ttyACM0", "")
    return Candidate(role, f"{driver} at {address}", {"driver": driver, "address": address})


def _with_keys(
    rig: NewRig, role: str, given: Mapping[str, Any], dialogue: Dialogue, source: str
) -> NewRig:
    """Return the rig with the keys of a device that a person is asked for, until they are valid."""
    asked = {key: text for key, text in rig.asked_keys(role, source).items() if key not in given}
    while True:
        for key, text in asked.items():
            before = rig.devices[role].get(key, USUAL.get(role, {}).get(key, ""))
            answer = dialogue.ask(f"  {role}.{key} ({text})", str(before))
            value = parse_yaml(f"value: {answer}", source)["value"]
            keys = {k: v for k, v in rig.devices[role].items() if k != key}
            rig = rig.with_device(role, keys if value is None else {**keys, key: value})
        refusal = rig.refusal(role, source)
        if not refusal:
            return rig
        asked = {key: text for key, text in asked.items() if f"{key}:" in refusal}
        if not (asked and dialogue.is_person):
            raise UsageError(refusal)
        dialogue.tell(f"  ! {refusal}")


def set_up(rig: NewRig, dialogue: Dialogue, source: str) -> NewRig:
    """Return the rig with the relay of its lamp seen, and the ends of its servos found by keys.

    Parameters
    ----------
    rig
        Rig with all devices.
    dialogue
        The person at the bench.
    source
        Path of the rig file, for messages.

    Returns
    -------
    NewRig
        The rig with the keys that were found.

    Raises
    ------
    DeviceError
        A device does not answer.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.yaml_file import read_yaml
    >>> from labrig.setup import NewRig, Unattended, set_up
    >>> room = read_yaml(Path("runs/decay/rig.yaml"))
    >>> rig = NewRig("attic", room["devices"], simulated=room)
    >>> set_up(rig, Unattended(lambda text: None), "rig.yaml").devices["door"]["closed"]
    '1000 us'
    """
    while LAMP.key in rig.devices and not _lamp_is_seen(rig, dialogue, source):
        rig = _with_keys(rig, LAMP.key, {}, dialogue, source)
    ends: dict[str, dict[str, str]] = {}
    with open_bench(rig.file(source), source) as bench, bench.devices() as devices:
        for role in (DOOR, SHIELD):
            part = devices.devices.get(role.key)
            if isinstance(part, ServoSwing) and isinstance(part.ends_at()[0], float):
                ends[role.key] = _ends(role.key, part, bench, dialogue)
            elif part is not None:
                dialogue.tell(
                    f"{role.key}: its board takes commands or names of places, no pulses: its ends "
                    "are as given, and the check swings it"
                )
    for key, places in ends.items():
        rig = rig.with_device(key, {**rig.devices[key], **places})
    return rig


def _lamp_is_seen(rig: NewRig, dialogue: Dialogue, source: str) -> bool:
    """Light the lamp for a moment and return whether a person saw it; it is off in any case."""
    with open_bench(rig.file(source), source) as bench, bench.devices() as devices:
        dialogue.tell(f"The lamp is lit for {LIT_S:g} s now.")
        devices[LAMP].on()
        bench.clock.sleep(LIT_S)
    return dialogue.confirm("Did it shine?")


def _ends(key: str, part: ServoSwing, bench: Bench, dialogue: Dialogue) -> dict[str, str]:
    """Return the keys of the ends to which a person moved a servo, and of its travel."""
    dialogue.tell(
        f"{key}: the keys + and - move it by 10 us, > and < by 100 us; Enter keeps the place."
    )
    places: dict[str, str] = {}
    for (name, _), pulse_s in zip(part.ends, part.ends_at(), strict=True):
        part.go(pulse_s)
        dialogue.tell(f"{key}, {name}: {_us(pulse_s)}")
        while (pressed := dialogue.key()) not in ENTER:
            bench.clock.sleep(0.0)  # where a stop that was asked for takes effect
            pulse_s = min(max(pulse_s + STEPS_S.get(pressed, 0.0), SHORTEST_S), LONGEST_S)
            part.go(pulse_s)
            dialogue.tell(f"{key}, {name}: {_us(pulse_s)}")
        places[name] = _us(pulse_s)
    if len(set(places.values())) == 1:
        raise UsageError(f"{key}: expected two different places, got {places.popitem()[1]} twice")
    return places | _travel(key, part, bench, dialogue)


def _travel(key: str, part: ServoSwing, bench: Bench, dialogue: Dialogue) -> dict[str, str]:
    """Return the travel until a person sees that a part has stopped; none if no time passed."""
    dialogue.tell(f"{key}: after the next Enter it swings; press Enter again when it has stopped.")
    while dialogue.key() not in ENTER:
        pass
    begun_s = bench.clock.now()
    part.swing(safe=True)
    while dialogue.key() not in ENTER:
        pass
    steps = int((bench.clock.now() - begun_s) / TRAVEL_STEP_S)
    return {"travel": f"{(steps + 1) * TRAVEL_STEP_S * 1e3:.0f} ms"} if steps else {}


def _us(pulse_s: float) -> str:
    return f"{pulse_s * 1e6:.0f} us"


def measure(rig: NewRig, source: str) -> tuple[NewRig, RigReport]:
    """Return the rig with lags and settings that its devices show in a check, and the check.

    Parameters
    ----------
    rig
        Rig with all devices.
    source
        Path of the rig file, for messages.

    Returns
    -------
    rig : NewRig
        The rig with the keys that the check suggests, and comments on what it measured.
    report : RigReport
        The check.

    Raises
    ------
    DeviceError
        A device cannot be opened.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.yaml_file import read_yaml
    >>> from labrig.setup import NewRig, measure
    >>> room = read_yaml(Path("runs/decay/rig.yaml"))
    >>> rig, report = measure(NewRig("attic", room["devices"], simulated=room), "rig.yaml")
    >>> report.failures, rig.devices["camera"]["isos"][:3]
    ((), [100, 200, 400])
    """
    with open_bench(rig.file(source), source) as bench:
        report = check_rig(bench)
    return rig.with_report(report), report
