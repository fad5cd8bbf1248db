"""The simulated dark room: one lamp, samples on the table, one camera looking at them."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UsageError

from .arrangement import Arrangement, Arrangements
from .bench_settings import FilterWheelSettings
from .cards import reflectances
from .changer import Changer, SampleHolder
from .circuit import LampCircuit
from .dng import Shot, encode_dng
from .door import Door, Doors, Pulses, no_pulses
from .faults import FaultTime, given
from .filters import Filters
from .imaging import (
    LIVE_EXPOSURE_S,
    LIVE_F_NUMBER,
    Imaging,
    developed,
    live_stride,
)
from .lamp import BURNING_K, SETTLED_S, WAVELENGTH_NM, filament_spectrum
from .lamps import FilteredLamps, Illuminants
from .leds import LedCircuit, Leds
from .lights import Lights, VisibleLight, leak, room_light_spectrum
from .optics import (
    FOCAL_MM,
    CameraCurves,
    bent_curves,
    film,
    glass,
    luminance_mcd_per_m2,
    measured_curves,
    vignetting,
)
from .sensor import (
    BAYER_RGGB,
    Course,
    ExposureCourse,
    Sensor,
    SensorTemperature,
    gain_electrons_per_dn,
)
from .simulation import Simulation
from .truth import Truth, true_lvf, true_patches
from .view import Table
from .wander import OrnsteinUhlenbeckNoise, Ripple

#: Rounding of times that were added up differently.
TICK_S = 1e-6

#: Streams of random numbers drawn from the seed, so that one does not shift another.
CURVES_STREAM, SENSOR_STREAM, FRAME_STREAM, LIVE_STREAM = 0, 1, 2, 3
FLICKER_STREAM, BLACK_STREAM, RIPPLE_STREAM = 30, 31, 32


class Room:
    """Everything between the relay that feeds the lamp and the bytes that leave the camera.

    Parameters
    ----------
    simulation
        Settings of the room.
    clock
        The room's clock; its zero is the epoch, at which the camera was switched on.
    pulses
        Function of a channel that returns the pulses sent to its servo up to now.

    Raises
    ------
    UsageError
        A material does not exist or cannot glow, or a patch is outside the frame.
    """

    def __init__(
        self, simulation: Simulation, clock: VirtualClock, pulses: Pulses = no_pulses
    ) -> None:
        self._simulation = simulation
        self._clock = clock
        changer = simulation.sample_changer
        self._holder = SampleHolder(changer, pulses)
        self._tables = [
            Table.of(table, None if changer is None else place, changer.leak if changer else 0.0)
            for place, table in enumerate(simulation.tables())
        ]
        faults = simulation.faults
        self._circuit = LampCircuit(simulation.lamp, simulation.initial.lamp == "on", faults, clock)
        leds = Leds(simulation.leds, passed=film(simulation.polarisers))
        self._led_circuit = LedCircuit(leds, simulation.initial.leds, faults, clock)
        self._room_light_spans = given(fault.light_left_on for fault in faults)
        leaks = [
            leak(fault_leak.level, [fault_leak])
            for fault_leak in given(fault.ambient_light for fault in faults)
        ]
        always = [leak(simulation.ambient, [FaultTime()])] if simulation.ambient else []
        self._leaks = (*always, *leaks)
        self._doors = Doors(simulation, clock, pulses)
        self._filters = Filters(
            simulation.filters,
            simulation.filters_bent,
            simulation.seed,
            simulation.monochromator,
        )
        lamps = simulation.illuminants
        filters = tuple(self._filters.transmission(lamp.filter) for lamp in lamps)
        self._illuminants = Illuminants(lamps=lamps, filters=filters)
        self._changer = Changer(
            simulation, self._filters, clock, freshen=self._freshen, plug=self._circuit.plug
        )
        sensor = simulation.sensor
        self._curves = (
            bent_curves(self._rng(CURVES_STREAM))
            if sensor.curves is None
            else measured_curves(sensor.curves)
        )
        edge_nm = None if simulation.lens is None else simulation.lens.uv_edge_nm
        before_sensor = glass(edge_nm) * film(simulation.polarisers)
        self._curves = CameraCurves(before_sensor * self._curves.sensitivity)
        self._sensor = Sensor(
            self._rng(SENSOR_STREAM),
            self._falloff(sensor.height, sensor.width),
            sensor.flicker,
            crosstalk=sensor.crosstalk,
            row_noise=sensor.row_noise,
            nonlinearity=sensor.nonlinearity,
            flicker_course=self._flicker_course(),
            ripple=self._ripple(),
            black_course_dn=self._black_course_dn(),
            subtracts_black=sensor.subtracts_black,
        )
        self._imaging = Imaging(simulation.imaging, simulation.seed)
        self._sensor_temperature = SensorTemperature()

    @property
    def lamp_on(self) -> bool:
        """Whether the lamp has current, whatever the states of register and bulb."""
        return self._circuit.closed

    @property
    def leds(self) -> Leds:
        """The bank of LEDs with its history up to now."""
        return self._led_circuit.leds

    @property
    def illuminants(self) -> Illuminants:
        """The bank of broadband lamps with its history up to now."""
        return self._illuminants

    @property
    def door(self) -> Door | None:
        """The trap door with its history up to now; None where there is none."""
        return self._doors.trap_door

    @property
    def tasks(self) -> Mapping[str, Callable[..., None]]:
        """Tasks of the changer in the room, by their command line."""
        return {**self._changer.tasks, "holder NUMBER": self._turn_holder}

    @property
    def arrangements(self) -> Arrangements:
        """Arrangements of the bench up to now."""
        return self._holder.with_places(self._changer.arrangements)

    def _table(self, arrangement: Arrangement) -> Table:
        """Return what lies before lamp and camera."""
        return self._tables[arrangement.in_place]

    def _turn_holder(self, number: str) -> None:
        """Turn the sample changer that has no servo to a place, 0 for none."""
        changer = self._simulation.sample_changer
        if changer is None or changer.channel is not None:
            raise UsageError("there is none that obeys, see 'simulation.sample_changer'")
        if not number.isdecimal() or int(number) > len(changer.places):
            raise UsageError(f"expected a place from 0 to {len(changer.places)}, got '{number}'")
        self._holder.turn(int(number), self._clock.now())

    def switch_lamp(self, on: bool) -> None:
        """Ask the lamp's relay to switch now."""
        self._circuit.ask(on)

    def switch_led(self, relay: int, on: bool) -> None:
        """Ask a relay to move now, to which an LED may be connected."""
        self._led_circuit.ask(relay, on)

    def switch_illuminant(self, relay: int, on: bool) -> None:
        """Move the contact of a relay now, to which a broadband lamp may be connected."""
        self._illuminants = self._illuminants.switched(relay, on, self._clock.now())

    def dim_led(self, relay: int, fraction: float) -> None:
        """Change the brightness of an LED now, as a fraction of its full light."""
        self._led_circuit.dim(relay, fraction)

    def turn_wheel(self, slot: int) -> None:
        """Have a slot of the filter wheel, from 1 on, before the lamp."""
        self._changer.turn_wheel(_in_slot(self._simulation.filter_wheel, slot))

    def turn_camera_wheel(self, slot: int) -> None:
        """Have a slot of the filter wheel before the camera, from 1 on, before it."""
        self._changer.turn_camera_wheel(_in_slot(self._simulation.camera_filter_wheel, slot))

    def tune(self, wavelength_nm: float, is_open: bool) -> None:
        """Have the monochromator tuned to a wavelength, its shutter open or closed."""
        self._changer.tune(wavelength_nm, is_open)

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        """Return the DNG of an exposure that is over.

        Parameters
        ----------
        start_s, exposure_s
            Begin and duration of the exposure on the room's clock, in seconds.
        iso, f_number
            Sensitivity and aperture of the camera.

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
        light: NDArray[np.float32] | None = None
        for begin_s, stop_s, arrangement in self.arrangements.spans(start_s, end_s):
            reflected = lights.seen(begin_s, stop_s)
            rgb = self._electrons(begin_s, stop_s, arrangement, lights, reflected, f_number)
            table = self._table(arrangement)
            painted = table.layout.places(arrangement).painted
            part = rgb[:, BAYER_RGGB].reshape(-1)[painted]
            if table.spheres is not None and arrangement.card in ("sample", "lit sample"):
                part = self._shaded(part, table, arrangement, reflected, f_number)
            part = self._imaging.textured(part, arrangement)
            light = part if light is None else light + part
        assert light is not None
        wall_s = self._clock.wall(start_s)
        mosaic = self._sensor.expose(
            self._imaging.imaged(light),
            exposure_s,
            iso,
            self._sensor_temperature.expose(start_s, exposure_s),
            self._rng(FRAME_STREAM, round(wall_s * 1e6)),
            wall_s,
        )
        lens = self._simulation.lens
        lens_notes = None if lens is None else lens.notes
        shot = Shot(wall_s, exposure_s, iso, f_number, lens_notes)
        return encode_dng(mosaic, shot, self._sensor.levels)

    def white_exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt at a white reference beside the samples, on `WAVELENGTH_NM`.

        The trap door does not come before it; the shield of the lamp does.
        """
        return self._lights().seen(start_s, end_s).cloth

    def spectrometer_exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt of what the spectrometer faces, as from a white of reflectance 1.

        That is the grey card, the sample that the changer has put before it, or else a white
        reference beside the samples.
        """
        total = np.zeros_like(WAVELENGTH_NM)
        for begin_s, stop_s, arrangement in self.arrangements.spans(start_s, end_s):
            light = self.white_exposure(begin_s, stop_s)
            if arrangement.card == "grey card":
                light = reflectances("grey card", self._simulation.grey_card)[1] * light
            elif arrangement.faced:
                surfaces = self._table(arrangement).surfaces
                (light,) = surfaces.thrown_back(light, np.array([arrangement.faced]))
            total += light
        return total

    def preview(self, at_s: float) -> NDArray[np.uint8]:
        """Return the viewfinder's picture for a display, R, G, B, with the room light if any.

        That light is for display only: it does not charge the samples.
        """
        arrangement = self.arrangements.at(at_s)
        start_s = max(at_s - LIVE_EXPOSURE_S, 0.0)
        lights = self._lights()
        reflected = lights.seen(start_s, at_s)
        if self._simulation.room_light:
            light, opened = (at_s - start_s) * room_light_spectrum(), lights.openness(at_s)
            reflected = VisibleLight(
                reflected.sample,
                reflected.sample_stray + opened * light,
                reflected.door + (1 - opened) * light,
                reflected.cloth + light,
            )
        rgb = self._electrons(start_s, at_s, arrangement, lights, reflected, LIVE_F_NUMBER)
        painted = self._table(arrangement).layout.places(arrangement).painted
        step = 2 * live_stride(*painted.shape)
        place = painted[::step, ::step] // len(BAYER_RGGB)
        return developed(
            rgb.astype(np.float64)[place] * self._falloff(*place.shape)[:, :, None],
            self._rng(LIVE_STREAM, round(self._clock.wall(at_s) * 1e6)),
        )

    def truth(self, iso: int = 400, f_number: float = 4.0) -> Truth:
        """Return the result of a perfect fit of the decay after the last lamp off."""
        lamps = self._lamps()
        off_s = lamps.last_switch_off(self._clock.now())
        level = effective = None
        off_or_now_s = self._clock.now() if off_s is None else off_s
        arrangements = self.arrangements
        table = self._table(arrangements.at(off_or_now_s))
        faster = table.samples.cells.rate_factor(off_or_now_s)
        if off_s is not None:
            level_at_off = table.samples.level_at(off_s, self._lights(), arrangements)
            level_later, _ = table.samples.evolve(
                level_at_off, off_s, off_s + SETTLED_S, arrangements.at(off_s), lamps.until(off_s)
            )
            level = table.samples.of_cells(level_at_off)
            effective = table.samples.extrapolated(level_at_off, level_later, off_s)
        electrons_per_s = self._curves.glow_electrons_per_s(table.samples.radiance_at_one, f_number)
        return Truth(
            lamp_off_s=off_s,
            iso=iso,
            f_number=f_number,
            patches=true_patches(
                table.simulation,
                table.samples,
                table.layout,
                level,
                effective,
                faster * electrons_per_s / gain_electrons_per_dn(iso),
                faster,
            ),
            wavelength_nm=tuple(WAVELENGTH_NM),
            sensitivity=tuple(tuple(row) for row in self._curves.sensitivity),
            lamp_irradiance=tuple(filament_spectrum(BURNING_K)),
            lvf=true_lvf(self._simulation),
        )

    def true_dn_per_s(
        self, start_s: float, exposure_s: float, iso: int = 400, f_number: float = 4.0
    ) -> FloatArray:
        """Return the glow of every patch in an exposure as a perfect camera would see it.

        Parameters
        ----------
        start_s, exposure_s
            Begin and duration of the exposure on the room's clock, in seconds; with the lamp off.
        iso, f_number
            Sensitivity and aperture of the camera.

        Returns
        -------
        ndarray, shape (patches, 3)
            Mean signal in R, G, B in DN per second of exposure, in the middle of the lens.
        """
        arrangement, lights = self.arrangements.at(start_s), self._lights()
        samples, layout = self._table(arrangement).samples, self._table(arrangement).layout
        level = samples.level_at(start_s, lights, self.arrangements)
        glow_s = samples.glow(level, start_s, start_s + exposure_s, arrangement, lights)
        electrons = self._curves.glow_electrons_per_s(glow_s / exposure_s, f_number)
        means = []
        for number in range(1, layout.patch.max() + 1):
            cells = layout.patch == number
            pixels = layout.pixels[cells]
            means.append(np.average(electrons[cells], axis=0, weights=pixels))
        return np.array(means) / gain_electrons_per_dn(iso)

    def true_luminance(self, start_s: float, exposure_s: float = 1e-3) -> FloatArray:
        """Return the mean luminance of the glow of every patch in mcd/m², shape (patches,).

        Parameters
        ----------
        start_s, exposure_s
            Begin and duration on the room's clock, in seconds; with the lamp off.
        """
        arrangement, lights = self.arrangements.at(start_s), self._lights()
        samples, layout = self._table(arrangement).samples, self._table(arrangement).layout
        level = samples.level_at(start_s, lights, self.arrangements)
        glow_s = samples.glow(level, start_s, start_s + exposure_s, arrangement, lights)
        light = luminance_mcd_per_m2(glow_s / exposure_s, self._simulation.lamp)
        cells = [layout.patch == n for n in range(1, layout.patch.max() + 1)]
        return np.array([np.average(light[cell], weights=layout.pixels[cell]) for cell in cells])

    def write_truth(self, path: Path) -> None:
        """Write `truth()` as a JSON file, next to a run, for tests."""
        self.truth().write(path)

    def _lamps(self) -> FilteredLamps:
        return FilteredLamps(
            self._circuit.lamp,
            self._circuit.mercury,
            self._filters.history(self.arrangements),
            self._led_circuit.leds,
            self._illuminants,
        )

    def _lights(self) -> Lights:
        doors = self._doors
        return Lights(
            self._lamps(), self._room_light_spans, doors.trap_door, doors.shield, self._leaks
        )

    def _flicker_course(self) -> Course | None:
        over_s = self._simulation.sensor.flicker_over
        return None if over_s is None else OrnsteinUhlenbeckNoise(self._rng(FLICKER_STREAM), over_s)

    def _ripple(self) -> ExposureCourse | None:
        sensor = self._simulation.sensor
        if not sensor.ripple:
            return None
        return Ripple(self._rng(RIPPLE_STREAM), sensor.ripple, sensor.ripple_period).mean

    def _black_course_dn(self) -> Course | None:
        sensor = self._simulation.sensor
        if not sensor.black_wander_dn:
            return None
        wander = OrnsteinUhlenbeckNoise(self._rng(BLACK_STREAM), sensor.black_wander_over)
        return lambda wall_s: sensor.black_wander_dn * wander(wall_s)

    def _falloff(self, height: int, width: int) -> FloatArray:
        lens = self._simulation.lens
        return vignetting(height, width, FOCAL_MM if lens is None else lens.focal_mm)

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._simulation.seed, *stream])

    def _freshen(self) -> None:
        samples = self._table(self.arrangements.last).samples
        samples.freshen(self._clock.now(), self._lights(), self.arrangements)

    def _electrons(
        self,
        start_s: float,
        end_s: float,
        arrangement: Arrangement,
        lights: Lights,
        reflected: VisibleLight,
        f_number: float,
    ) -> NDArray[np.float32]:
        """Return the expected electrons in the middle of the lens, shape (places, 3)."""
        table = self._table(arrangement)
        level = table.samples.level_at(start_s, lights, self.arrangements)
        glow_s = table.samples.glow(level, start_s, end_s, arrangement, lights)
        opened = lights.openness((start_s + end_s) / 2)
        radiance_s = table.view.radiance_s(arrangement, glow_s, reflected, opened)
        radiance_s *= self._filters.before_camera(arrangement)
        return self._curves.glow_electrons_per_s(radiance_s, f_number).astype(np.float32)

    def _shaded(
        self,
        light: NDArray[np.float32],
        table: Table,
        arrangement: Arrangement,
        reflected: VisibleLight,
        f_number: float,
    ) -> NDArray[np.float32]:
        """Return the expected electrons of all pixels with the shading of the spheres."""
        assert table.spheres is not None
        radiance_s = table.view.reradiated_s(arrangement, reflected)
        rgb = self._curves.glow_electrons_per_s(radiance_s, f_number)
        painted = table.layout.places(arrangement).painted
        reradiated = rgb[:, BAYER_RGGB].reshape(-1)[painted]
        shaded: FloatArray = (
            light - reradiated
        ) * table.spheres.reflected + reradiated * table.spheres.reradiated
        return np.maximum(shaded, 0.0).astype(np.float32)


def _in_slot(wheel: FilterWheelSettings | None, slot: int) -> str | None:
    """Return the name of the filter in a slot, from 1 on; None for an open one."""
    filters = () if wheel is None else wheel.filters
    return filters[slot - 1] if slot <= len(filters) else None
