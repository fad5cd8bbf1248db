"""Whole sessions with a camera whose containers come to harm on the way, either way.

A case is one harmed container. The real driver talks to the simulated cameras, a Canon EOS and one
that knows the standard only, over a USB bus that flips bits, cuts off, repeats, swaps,
loses, lengthens and invents containers. All time is virtual. What must hold:

- the driver raises nothing but `DeviceError`, one line each, that shows what came and says what to
  do;
- the simulated camera raises nothing, whatever it is told;
- nothing hangs: steps and virtual time have a bound;
- afterwards, with nothing harmed any more, the same driver photographs on the same connection,
  unless it gives up with such a `DeviceError`; how often it did is counted;
- then the next program gets its own photograph, whatever the last one left behind.
"""

import random
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import MappingProxyType

from labrig.acquire.connections import Connections
from labrig.acquire.values import CameraCapabilities, ExposureSettings
from labrig.drivers.ptp import PtpCamera
from labrig.drivers.ptp.failures import MalformedError, RefusedError
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from tests.counterparts.served import EOS, EPOCH_S, STANDARD, camera_on

from .lines import LiveFilm, Transport, over_usb
from .mutations import Mutator

#: Lab time in which a session must be over, whatever came: some tens of time-outs.
MAX_SESSION_S = 1200.0
#: Between the last harm and what must work again: a long exposure by mistake is over.
PAUSE_S = 120.0
MAX_ATTEMPTS = 3
#: Of the containers of a session that come to harm.
FRACTIONS = (0.03, 0.1, 0.3)
#: With which act harm begins; 0 is connecting, 6 a photograph, 9 one at bulb.
BEGINNINGS = (0, 0, 1, 2, 4, 6, 6, 7, 9)
SIZES = (500, 3000, 3 * 512 - 12, 70_000)
#: A true 32 s is the dial's longest: an EOS takes this one at bulb.
BULB_S = 64.0
RIG_KEYS = {"longest_exposure": f"{BULB_S:g} s", "transfer_timeout": "10 s"}

SHOWN = re.compile(r"got (nothing|(\d+ bytes )?'[0-9a-f]{2}( [0-9a-f]{2})*( …)?')")
REMEDY = re.compile(
    r": (aim|allow|check|choose|close|make|put|set|start|switch|take|try|turn|unplug|use|wait) "
)


@dataclass(frozen=True)
class Way:
    """Over what, and which way harm is done."""

    transport: Transport
    harms_camera: bool


WAYS = MappingProxyType(
    {
        "camera to driver, USB": Way(over_usb, harms_camera=False),
        "driver to camera, USB": Way(over_usb, harms_camera=True),
    }
)


@dataclass
class Tally:
    """What happened so far, one way.

    Attributes
    ----------
    cases
        Harmed containers, by the kind of harm.
    sessions
        By the body at the other end.
    bulbs
        Photographs at bulb that were taken in spite of all.
    refused
        Errors of the driver, by their class; `texts` has an example of each.
    attempts
        Sessions by how many attempts the photograph afterwards took; 0 where none succeeded.
    longest_s
        Lab time of the longest session.
    """

    cases: Counter[str] = field(default_factory=Counter)
    sessions: Counter[str] = field(default_factory=Counter)
    bulbs: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    texts: dict[str, str] = field(default_factory=dict)
    attempts: Counter[int] = field(default_factory=Counter)
    longest_s: float = 0.0

    def refuse(self, error: DeviceError) -> None:
        """Note a refusal; it must be one line that shows what came, and says what to do."""
        text = str(error)
        self.refused[type(error).__name__] += 1
        self.texts.setdefault(template(text), text)
        assert text.isprintable(), f"not one line: {text!r}"
        assert REMEDY.search(f"{text} "), f"does not say what to do: {text}"
        if isinstance(error, MalformedError):
            assert SHOWN.search(text), f"does not show what came: {text}"
        if isinstance(error, RefusedError):
            assert f"got 0x{error.code:04X}" in text, f"does not show what came: {text}"


def template(text: str) -> str:
    """`text` without its numbers."""
    return re.sub(r"[0-9a-f]{2}( [0-9a-f]{2})+|(0x)?[0-9A-F]*\d[0-9A-Fx]*|'[^']*'", "#", text)


def sessions(name: str, cases: int, seed: int, tally: Tally) -> Iterator[str]:
    """Sessions one way until so many containers were harmed.

    Yields
    ------
    failure
        Of each session, what did not hold and which session that was; empty if all did.
    """
    number = 0
    while tally.cases.total() < cases:
        try:
            session(name, seed, number, tally)
        except Exception as failure:
            yield f"{failure!r}"[:400] + f", in session {number}"
        else:
            yield ""
        number += 1


def session(name: str, seed: int, number: int, tally: Tally) -> None:
    """One session with harm done, then what must work all the same.

    Raises
    ------
    AssertionError
        It did not.
    """
    way, rng = WAYS[name], random.Random(f"{seed}/{name}/{number}")
    clock, film = VirtualClock(EPOCH_S), LiveFilm(size=rng.choice(SIZES))
    body = rng.choice((EOS, EOS, STANDARD))
    harming, harmless = Mutator(rng, rng.choice(FRACTIONS)), Mutator(rng, 0.0)
    mutators = (harming, harmless) if way.harms_camera else (harmless, harming)
    responder = camera_on(clock, film, body).responder
    tally.sessions[body.body] += 1
    try:
        with way.transport(clock, responder, *mutators) as (address, line):
            camera = _use(rng, address, line, harming, tally)
            tally.longest_s = max(tally.longest_s, clock.now())
            assert clock.now() < MAX_SESSION_S, f"it takes {clock.now():.0f} s of lab time"
            harming.stop()
            clock.spend(PAUSE_S)
            if camera is not None:
                frame = _mended(camera, tally)
                assert frame in (None, *film.delivered[-1:]), "another frame"
                camera.disconnect()
            camera = _connect(address, line)
            assert _photograph(camera) == film.delivered[-1], "another frame"
            camera.make_safe()
            camera.disconnect()
    finally:
        tally.bulbs += sum(taken.exposure_s > 0.9 * BULB_S for taken in film.taken)
        tally.cases += harming.cases


def _connect(address: str, line: Connections) -> PtpCamera:
    return PtpCamera(address, PtpCamera.Settings.model_validate(RIG_KEYS), line)


def _mended(camera: PtpCamera, tally: Tally) -> bytes | None:
    """A photograph after the safe state, at once or when what is still damaged was noticed.

    None if the driver gave up, as it must where damage could not be noticed: a list of choices
    that came under the name of another property, say.
    """
    for attempt in range(1, MAX_ATTEMPTS + 1):
        try:
            camera.make_safe()
            frame = _photograph(camera)
        except DeviceError as error:
            tally.refuse(error)
        else:
            tally.attempts[attempt] += 1
            return frame
    tally.attempts[0] += 1
    return None


def _photograph(camera: PtpCamera, exposure_s: float = 1 / 64) -> bytes:
    camera.configure(_settings(camera.capabilities(), exposure_s))
    camera.arm()
    return camera.shoot().data


def _settings(capabilities: CameraCapabilities, exposure_s: float) -> ExposureSettings:
    f_number = (
        capabilities.f_numbers[len(capabilities.f_numbers) // 2] if capabilities.f_numbers else None
    )
    return ExposureSettings(
        capabilities.exposure_at_most(exposure_s), capabilities.isos[-1], f_number
    )


def _use(
    rng: random.Random, address: str, line: Connections, harming: Mutator, tally: Tally
) -> PtpCamera | None:
    """What a run does with a camera, going on after every refusal; harm may begin later."""
    begins = rng.choice(BEGINNINGS)
    harming.is_on = begins == 0
    try:
        camera = _connect(address, line)
    except DeviceError as error:
        tally.refuse(error)
        return None
    acts: list[Callable[[], object]] = [
        camera.findings,
        camera.preview,
        camera.capabilities,
        lambda: camera.configure(_settings(camera.capabilities(), rng.choice((0.1, 1.0, 8.0)))),
        camera.arm,
        camera.shoot,
        camera.keep_awake,
        camera.shoot,
        lambda: _photograph(camera, BULB_S),
        camera.make_safe,
    ]
    for number, act in enumerate(acts, start=1):
        harming.is_on |= number >= begins
        try:
            act()
        except DeviceError as error:
            tally.refuse(error)
            try:
                camera.make_safe()
            except DeviceError as unsafe:
                tally.refuse(unsafe)
    return camera
