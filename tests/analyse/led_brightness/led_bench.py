"""Runs of led_brightness on the simulated bench with LEDs, and what is true there."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.yaml_file import validate
from labrig.protocols.led_brightness.analysis import analyse
from labrig.protocols.led_brightness.result import LedBrightnessResult
from labrig.record import read_run
from labrig.results import read_result
from labrig.sim.lamp import WAVELENGTH_NM
from labrig.sim.leds import led_spectrum
from labrig.sim.opening import PIXEL_STREAM
from labrig.sim.simulation import Simulation
from labrig.sim.spectrometer import Detector
from tests.analyse.recorded import part_of, processed_once, record, shipped_rig

QUICK = {"protocol": "led_brightness", "sample": {"name": "bank"}, "exposures": 1, "repeats": 1,
         "repetitions": 3, "integration": "0.2 s", "longest": "4 s"}  # fmt: skip
Rig = dict[str, Any]


def recorded(
    folder: Path, change: Callable[[Rig], None] = lambda rig: None, **protocol: Any
) -> Path:
    """The folder of a run on the shipped rig with LEDs, as `change` leaves it."""

    def fluorescent(rig: Rig) -> None:
        rig.clear()
        rig |= shipped_rig("sim-fluorescent")
        rig["devices"]["camera"]["warm_up"] = "1 min"
        del rig["devices"]["spectrometer"]["calibration"]
        change(rig)

    return record(folder, QUICK | protocol, fluorescent)


def result_of(run: Path) -> LedBrightnessResult:
    """The result of a run's analysis."""
    return analyse(part_of(run))


def processed(run: Path) -> LedBrightnessResult:
    """The result as it is written, read and shown."""
    processed_once(run)
    result = read_result(run)
    assert isinstance(result, LedBrightnessResult)
    return result


def without_spectrometer(rig: Rig) -> None:
    """Take the spectrometer away."""
    del rig["devices"]["spectrometer"]


def calibrated(rig: Rig, folder: Path) -> None:
    """Give the spectrometer an absolute scale, as right as its σ of half a per cent says."""
    seed = rig["simulation"]["seed"]
    detector = Detector(np.random.default_rng([seed, PIXEL_STREAM]))
    lit = detector.response > 0
    rng = np.random.default_rng(seed)
    knots_nm = np.arange(250.0, 1000.0, 120.0)
    off = np.interp(detector.wavelength_nm[lit], knots_nm, rng.normal(0.0, 0.011, len(knots_nm)))
    factor = detector.irradiance_per_count_rate()[lit] * (1 + off)
    rows = zip(detector.wavelength_nm[lit], factor, 0.005 * factor, strict=True)
    path = folder / "scale.csv"
    lines = [f"{nm!r},{value!r},{sigma!r}" for nm, value, sigma in (map(float, r) for r in rows)]
    path.write_text("wavelength_nm,value,sigma\n" + "\n".join(lines) + "\n")
    rig["devices"]["spectrometer"]["calibration"] = str(path)


def truth(run: Path) -> dict[str, tuple[float, float]]:
    """Centroid in nm and light of each LED while it was measured, by its name in the rig file."""
    part, record_ = part_of(run), read_run(run)
    assert part.rig.simulation is not None
    simulation = validate(part.rig.simulation, Simulation, "rig")
    names = list(part.rig.devices["leds"].settings()["channels"])
    by_relay = {led.relay: led for led in simulation.leds}
    found = {}
    for relay, name in enumerate(names, start=1):
        if relay not in by_relay or f"card {name}" not in record_.completed():
            continue
        led, attempt = by_relay[relay], record_.completed()[f"card {name}"]
        on = next(one for one in attempt.actions if one.action == f"{name} on").middle_time
        lit = ("led-spectrum", "led-card")
        spans = [(one.start_time, one.end_time) for one in attempt.spectra if one.role in lit]
        spans += [(one.start_time, one.end_time) for one in attempt.frames if one.role in lit]
        begin, end = min(span[0] for span in spans), max(span[1] for span in spans)
        since_s = np.linspace(begin - on, end - on, 200)
        warmth = float(np.mean(1 - np.exp(-since_s / led.warm_up)))
        warm = (1 - led.droop) * led_spectrum(led, led.shift_nm)
        light: FloatArray = (1 - warmth) * led_spectrum(led) + warmth * warm
        centroid = float(light @ WAVELENGTH_NM / light.sum())
        found[name] = centroid, float(light.sum() * np.diff(WAVELENGTH_NM)[0])
    return found


def shine_like(rig: Rig, folder: Path, relay: int, bands: dict[float, float]) -> None:
    """Give an LED a spectrum of normal bands: their relative light by their centres in nm."""
    wide = {centre: 40.0 if light < 0.5 else 16.0 for centre, light in bands.items()}
    shape = sum(
        light / wide[centre] * np.exp(-(((WAVELENGTH_NM - centre) / wide[centre] * 2.355) ** 2) / 2)
        for centre, light in bands.items()
    )
    path = folder / f"relay-{relay}.csv"
    rows = zip(WAVELENGTH_NM, np.broadcast_to(shape, WAVELENGTH_NM.shape), strict=True)
    path.write_text("wavelength_nm,value\n" + "".join(f"{nm},{value}\n" for nm, value in rows))
    rig["simulation"]["leds"][relay - 1]["spectrum"] = str(path)
