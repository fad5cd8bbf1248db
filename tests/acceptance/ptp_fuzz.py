"""Whole sessions with a camera whose containers come to harm on the way, either way.

    python -m tests.acceptance.ptp_fuzz [--cases 100000] [--seed 1] [--way NAME [--session N]]

A case is one harmed container. The real driver talks to the simulated cameras, a Canon EOS and one
that knows the standard only, over a USB bus or a network that flips bits, cuts off, repeats, swaps,
loses, lengthens and invents containers. All time is virtual. What must hold:

- the driver raises nothing but `DeviceError`, one line each, that shows what came;
- the simulated camera raises nothing, whatever it is told;
- nothing hangs: steps and virtual time have a bound; memory has one, too;
- afterwards, with nothing harmed any more, the next program gets its own photograph, and so does
  the same driver, unless it gives up with a `DeviceError`; how often it did is counted.
"""

import argparse
import random
import re
import resource
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from types import MappingProxyType

from drivers.ptp import PtpCamera
from drivers.ptp.failures import MalformedError, RefusedError
from labrig.acquire.connections import Connections
from labrig.acquire.values import CameraOffers, ExposureSettings
from labrig.clock import VirtualClock
from labrig.errors import DeviceError
from tests.counterparts.served import EOS, EPOCH_S, STANDARD, camera_on

from .ptp_mutated_lines import LiveFilm, Transport, over_network, over_usb
from .ptp_mutations import Mutator

#: Lab time in which a session must be over, whatever came: some tens of time-outs.
MOST_SESSION_S = 1200.0
#: Between the last harm and what must work again: a long exposure by mistake is over.
PAUSE_S = 120.0
MOST_ATTEMPTS = 3
#: Of the containers of a session that come to harm.
SHARES = (0.03, 0.1, 0.3)
#: With which act harm begins; 0 is connecting, 6 a photograph.
BEGINNINGS = (0, 0, 1, 2, 4, 6, 6, 7, 9)
SIZES = (500, 3000, 3 * 512 - 12, 70_000)
MOST_MEMORY_BYTES = 2 << 30
RIG_KEYS = {"longest_exposure": "64 s", "transfer_timeout": "10 s"}


@dataclass(frozen=True)
class Way:
    """Over what, and which way harm is done."""

    transport: Transport
    harms_camera: bool


WAYS = MappingProxyType(
    {
        "camera to driver, USB": Way(over_usb, harms_camera=False),
        "camera to driver, PTP/IP": Way(over_network, harms_camera=False),
        "driver to camera, USB": Way(over_usb, harms_camera=True),
        "driver to camera, PTP/IP": Way(over_network, harms_camera=True),
    }
)


@dataclass
class Tally:
    """What happened so far, one way."""

    cases: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    texts: dict[str, str] = field(default_factory=dict)
    failures: dict[str, list[str]] = field(default_factory=dict)
    sessions: int = 0
    gave_up: list[int] = field(default_factory=list)
    longest_s: float = 0.0

    def refuse(self, error: DeviceError) -> None:
        """Note a refusal; it must be one line that shows what came, if anything did."""
        text = str(error)
        self.refused[type(error).__name__] += 1
        self.texts.setdefault(_template(text), text)
        assert text.isprintable(), f"not one line: {text!r}"
        if isinstance(error, MalformedError | RefusedError):
            assert re.search(r"\d|[0-9a-f]{2} [0-9a-f]{2}", text), f"shows not what came: {text}"

    def fail(self, failure: str, how_again: str) -> None:
        """Note a failure, and how to see it again."""
        self.failures.setdefault(_template(failure), [failure]).append(how_again)


def _template(text: str) -> str:
    return re.sub(r"[0-9a-f]{2}( [0-9a-f]{2})+|(0x)?[0-9A-F]*\d[0-9A-Fx]*|'[^']*'", "#", text)


def session(rng: random.Random, way: Way, tally: Tally) -> bool:
    """One session with harm done, then what must work all the same; False if the driver gave up."""
    clock, film = VirtualClock(EPOCH_S), LiveFilm(size=rng.choice(SIZES))
    body = rng.choice((EOS, EOS, STANDARD))
    harming, harmless = Mutator(rng, rng.choice(SHARES)), Mutator(rng, 0.0)
    mutators = (harming, harmless) if way.harms_camera else (harmless, harming)
    responder = camera_on(clock, film, body).responder
    try:
        with way.transport(clock, responder, *mutators) as (address, line):
            camera = _use(rng, address, line, harming, tally)
            tally.longest_s = max(tally.longest_s, clock.now())
            assert clock.now() < MOST_SESSION_S, f"{clock.now():.0f} s of lab time"
            harming.stop()
            clock.spend(PAUSE_S)
            gave_up = False
            if camera is not None:
                frame = _mended(camera)
                assert frame in (None, *film.delivered[-1:]), "another frame"
                gave_up = frame is None
                camera.disconnect()
            camera = _connect(address, line)
            assert _photograph(camera) == film.delivered[-1], "another frame"
            camera.make_safe()
            camera.disconnect()
            return not gave_up
    finally:
        tally.sessions += 1
        tally.cases += harming.cases


def _connect(address: str, line: Connections) -> PtpCamera:
    return PtpCamera(address, PtpCamera.Settings.model_validate(RIG_KEYS), line)


def _mended(camera: PtpCamera) -> bytes | None:
    """A photograph after the safe state, at once or when what is still damaged was noticed.

    None if the driver gave up, as it must where damage could not be noticed: a list of choices
    that came under the name of another property, say.
    """
    for _ in range(MOST_ATTEMPTS):
        try:
            camera.make_safe()
            return _photograph(camera)
        except DeviceError:
            continue
    return None


def _photograph(camera: PtpCamera, exposure_s: float = 1 / 64) -> bytes:
    camera.configure(_settings(camera.offers(), exposure_s))
    camera.arm()
    return camera.shoot().data


def _settings(offers: CameraOffers, exposure_s: float) -> ExposureSettings:
    f_number = offers.f_numbers[len(offers.f_numbers) // 2] if offers.f_numbers else None
    return ExposureSettings(offers.exposure_at_most(exposure_s), offers.isos[-1], f_number)


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
        camera.offers,
        lambda: camera.configure(_settings(camera.offers(), rng.choice((0.1, 1.0, 8.0)))),
        camera.arm,
        camera.shoot,
        camera.keep_awake,
        camera.shoot,
        lambda: _photograph(camera, 64.0),
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


def fuzz(name: str, cases: int, seed: int, only: int | None) -> Tally:
    """As many harmed containers as asked for, one way."""
    tally, number = Tally(), only or 0
    while tally.cases.total() < cases:
        try:
            if not session(random.Random(f"{seed}/{name}/{number}"), WAYS[name], tally):
                tally.gave_up.append(number)
        except Exception as failure:
            again = f"--seed {seed} --way '{name}' --session {number}"
            tally.fail(f"{failure!r}"[:300], again)
            if only is not None:
                traceback.print_exc()
        if only is not None:
            break
        number += 1
    return tally


def main() -> None:
    """Print a few lines a way, and what failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000, help="harmed containers each way")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--way", choices=WAYS)
    parser.add_argument("--session", type=int, help="only this one, with its traceback")
    parser.add_argument("--texts", action="store_true", help="an example of each refusal")
    asked = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))
    for name in [asked.way] if asked.way else WAYS:
        began_s = perf_counter()
        tally = fuzz(name, asked.cases, asked.seed, asked.session)
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name:25} {tally.cases.total():7} cases, {tally.sessions:6} sessions, "
            f"{len(tally.gave_up)} given up {tally.gave_up[:4]}, longest {tally.longest_s:4.0f} s, "
            f"memory {peak_mb:4.0f} MB, {perf_counter() - began_s:4.0f} s, "
            f"{len(tally.failures)} kinds of failures"
        )
        print("   harm:    " + ", ".join(f"{n} {what}" for what, n in tally.cases.most_common()))
        print("   refused: " + ", ".join(f"{n} {kind}" for kind, n in tally.refused.most_common()))
        if asked.texts:
            print(*(f"      {text}" for text in sorted(tally.texts.values())), sep="\n")
        for failure, *again in tally.failures.values():
            print(f"   FAILED {len(again)} times, {again[0]}: {failure}")
        print(end="", flush=True)


if __name__ == "__main__":
    main()
