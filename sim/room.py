"""The simulated dark room: one lamp, samples on the table, one camera looking at them."""

from bisect import bisect_right
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.clock import VirtualClock
from labrig.material.file import read_material
from labrig.region import region_pixels

from .aiming import (
    LIVE_EXPOSURE_S,
    LIVE_F_NUMBER,
    developed,
    live_stride,
)
from .circuit import LampCircuit
from .dng import Shot, encode_dng
from .door import Door
from .doors import Doors, Pulses, no_pulses
from .faults import given
from .lamp import BURNING_K, SETTLED_S, WAVELENGTH_NM, filament_spectrum
from .lights import Lights, Seen, room_light_spectrum
from .optics import (
    CLOTH_REFLECTANCE,
    SAMPLE_REFLECTANCE,
    bent_curves,
    emission,
    measured_curves,
    vignetting,
)
from .phosphor import phosphor
from .sensor import BAYER_RGGB, Sensor, SensorTemperature, gain_electrons_per_dn
from .simulation import Simulation
from .truth import TruePatch, TrueState, Truth

FloatArray = NDArray[np.float64]

#: Rounding of times that were added up differently.
TICK_S = 1e-6

#: Streams of random numbers drawn from the seed, so that one does not shift another.
CURVES_STREAM, SENSOR_STREAM, FRAME_STREAM, LIVE_STREAM = 0, 1, 2, 3


class Room:
    """Everything between the relay that feeds the lamp and the bytes that leave the camera.

    Parameters
    ----------
    simulation
        What the room is like.
    clock
        The room's time; its zero is the epoch, at which the camera was switched on.
    pulses
        What the doors' servos are sent.

    Raises
    ------
    UsageError
        A material that does not exist or cannot glow, or a patch outside the frame.
    """

    def __init__(
        self, simulation: Simulation, clock: VirtualClock, pulses: Pulses = no_pulses
    ) -> None:
        self._simulation = simulation
        self._clock = clock
        self._patches = simulation.patches
        materials = [read_material(patch.material) for patch in self._patches]
        charges = [patch.initial_charge for patch in self._patches]
        self._names = [material.name for material in materials]
        self._phosphor = phosphor(materials, charges, simulation.lamp.irradiance)
        self._emission = np.concatenate([emission(material) for material in materials])
        self._circuit = LampCircuit(
            simulation.lamp, simulation.initial.lamp == "on", simulation.faults, clock
        )
        self._left_on = given(fault.light_left_on for fault in simulation.faults)
        self._doors = Doors(simulation, clock, pulses)
        sensor = simulation.sensor
        self._curves = (
            bent_curves(self._rng(CURVES_STREAM))
            if sensor.curves is None
            else measured_curves(sensor.curves)
        )
        falloff = vignetting(sensor.height, sensor.width)
        self._sensor = Sensor(
            self._rng(SENSOR_STREAM),
            falloff,
            sensor.flicker,
            crosstalk=sensor.crosstalk,
            row_noise=sensor.row_noise,
        )
        self._sensor_temperature = SensorTemperature()
        self._places = self._painted()
        # Where the samples have been followed to, by time. The past cannot change, so they stay
        # true; a photograph that is looked at late starts from the last one before it.
        self._known_s = [0.0]
        self._known_levels = [np.full(len(self._emission), simulation.initial.concentration)]

    @property
    def lamp_on(self) -> bool:
        """Whether the lamp has current, whatever register and bulb say."""
        return self._circuit.closed

    @property
    def door(self) -> Door | None:
        """The trap door with its history up to now; None where there is none."""
        return self._doors.trap_door

    def switch_lamp(self, on: bool) -> None:
        """Ask the lamp's relay to switch now."""
        self._circuit.ask(on)

    def change_sample(self) -> None:
        """Put another piece of the same materials in, now; it has been in the dark for long."""
        now_s = self._clock.now()
        self._level_at(now_s)
        self._known_s.append(now_s)
        self._known_levels.append(np.zeros(len(self._emission)))

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        """The DNG of an exposure that is over.

        Parameters
        ----------
        start_s, exposure_s
            On the room's clock.
        iso, f_number
            The camera's settings.

        Raises
        ------
        ValueError
            The exposure is not over yet, or began before the epoch.
        """
        end_s = start_s + exposure_s
        if not 0.0 <= start_s < end_s <= self._clock.now() + TICK_S:
            raise ValueError(
                f"expected an exposure between 0 s and {self._clock.now()} s (now), "
                f"got {start_s} s to {end_s} s"
            )
        lights = self._lights()
        _, glow_s = self._phosphor.evolve(
            self._level_at(start_s), start_s, end_s, lights, lights.openness
        )
        mosaic = self._sensor.expose(
            self._electrons(glow_s, lights.seen(start_s, end_s), f_number)[self._places],
            exposure_s,
            iso,
            self._sensor_temperature.expose(start_s, exposure_s),
            self._rng(FRAME_STREAM, round(self._clock.wall(start_s) * 1e6)),
        )
        return encode_dng(mosaic, Shot(self._clock.wall(start_s), exposure_s, iso, f_number))

    def preview(self, at_s: float) -> NDArray[np.uint8]:
        """The viewfinder's picture: R, G, B for a display, with the room light on if there is one.

        That light is for the eye only: it does not charge the samples.
        """
        start_s = max(at_s - LIVE_EXPOSURE_S, 0.0)
        lights = self._lights()
        _, glow_s = self._phosphor.evolve(
            self._level_at(start_s), start_s, at_s, lights, lights.openness
        )
        seen = lights.seen(start_s, at_s)
        if self._simulation.room_light:
            light, opened = (at_s - start_s) * room_light_spectrum(), lights.openness(at_s)
            seen = Seen(
                seen.sample + opened * light, seen.door + (1 - opened) * light, seen.cloth + light
            )
        electrons = self._electrons(glow_s, seen, LIVE_F_NUMBER)
        step = 2 * live_stride(*self._places.shape)
        patch = self._places[::step, ::step] // 4
        rgb = electrons.reshape(-1, 4)[:, [0, 1, 3]].astype(np.float64)[patch]
        return developed(
            rgb * vignetting(*patch.shape)[:, :, None],
            self._rng(LIVE_STREAM, round(self._clock.wall(at_s) * 1e6)),
        )

    def truth(self, iso: int = 400, f_number: float = 4.0) -> Truth:
        """What a perfect fit of the decay after the last lamp-off would find."""
        lamp = self._circuit.lamp
        off_s = lamp.last_switch_off(self._clock.now())
        level = effective = None
        if off_s is not None:
            level = self._level_at(off_s)
            dark_s = off_s + SETTLED_S
            after, _ = self._phosphor.evolve(level, off_s, dark_s, lamp.until(off_s))
            effective = after * np.exp(self._phosphor.k_r_per_s * SETTLED_S)
        electrons_per_s = self._curves.glow_electrons_per_s(self._radiance_at_one(), f_number)
        return Truth(
            lamp_off_s=off_s,
            iso=iso,
            f_number=f_number,
            patches=self._true_patches(
                level, effective, electrons_per_s / gain_electrons_per_dn(iso)
            ),
            wavelength_nm=tuple(WAVELENGTH_NM),
            sensitivity=tuple(tuple(row) for row in self._curves.sensitivity),
            lamp_irradiance=tuple(filament_spectrum(BURNING_K)),
        )

    def write_truth(self, path: Path) -> None:
        """`truth()` as a JSON file, next to a run, for tests."""
        self.truth().write(path)

    def _lights(self) -> Lights:
        return Lights(
            self._circuit.lamp,
            self._left_on,
            self._doors.trap_door,
            self._doors.shield,
        )

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._simulation.seed, *stream])

    def _level_at(self, time_s: float) -> FloatArray:
        """Concentrations of all states at a time, shape (states,)."""
        last = bisect_right(self._known_s, time_s) - 1
        level, _ = self._phosphor.evolve(
            self._known_levels[last], self._known_s[last], time_s, self._lights()
        )
        self._known_s.insert(last + 1, time_s)
        self._known_levels.insert(last + 1, level)
        return level

    def _radiance_at_one(self) -> FloatArray:
        """Λ k_r of every state, shape (states, wavelengths): its radiance at r = 1 (eq. 3)."""
        radiance: FloatArray = self._emission * self._phosphor.k_r_per_s[:, None]
        return radiance

    def _electrons(self, glow_s: FloatArray, seen: Seen, f_number: float) -> NDArray[np.float32]:
        """Expected electrons in the middle of the lens, flat over (cloth and patches, Bayer)."""
        radiance_s = np.zeros((1 + len(self._patches), len(WAVELENGTH_NM)))
        np.add.at(radiance_s, 1 + self._phosphor.patch, glow_s[:, None] * self._radiance_at_one())
        electrons = self._curves.glow_electrons_per_s(radiance_s, f_number)
        scale = self._simulation.lamp.irradiance
        sample, door, cloth = (
            self._curves.reflected_electrons(scale * light, f_number)
            for light in (seen.sample, seen.door, seen.cloth)
        )
        electrons[0] += CLOTH_REFLECTANCE * cloth
        electrons[1:] += SAMPLE_REFLECTANCE * sample + CLOTH_REFLECTANCE * door
        return electrons[:, BAYER_RGGB].astype(np.float32).reshape(-1)

    def _painted(self) -> NDArray[np.intp]:
        """For every pixel its place in `_electrons`; a later patch lies on an earlier one."""
        width, height = self._simulation.sensor.width, self._simulation.sensor.height
        patch = np.zeros((height, width), dtype=np.intp)
        for number, placed in enumerate(self._patches, start=1):
            x, y, wide, high = region_pixels(placed.region, width, height)
            patch[y : y + high, x : x + wide] = number
        bayer = np.tile(np.arange(4).reshape(2, 2), (height // 2, width // 2))
        return patch * 4 + bayer

    def _true_patches(
        self, level: FloatArray | None, effective: FloatArray | None, dn_per_s: FloatArray
    ) -> tuple[TruePatch, ...]:
        states: list[list[TrueState]] = [[] for _ in self._patches]
        for index in np.argsort(-self._phosphor.k_r_per_s, kind="stable"):
            red, green, blue = dn_per_s[index] * (0.0 if effective is None else effective[index])
            states[self._phosphor.patch[index]].append(
                TrueState(
                    k_r_per_s=self._phosphor.k_r_per_s[index],
                    concentration=None if level is None else level[index],
                    amplitude_dn_per_s=None if effective is None else (red, green, blue),
                )
            )
        return tuple(
            TruePatch(material=name, region=placed.region, states=tuple(of_patch))
            for name, placed, of_patch in zip(self._names, self._patches, states, strict=True)
        )
