"""The `simulation:` section of a rig file: settings of the simulated dark room."""

from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BeforeValidator,
    Field,
    field_validator,
    model_validator,
)

from labrig.foundation.named_files import FilePath, NamesFile, ShippedOrFile
from labrig.foundation.quantity import DurationS, Fraction
from labrig.foundation.region import Region

from .bench_settings import (
    DoorSettings,
    FilterWheelSettings,
    IlluminantSettings,
    ImagingSettings,
    LedSettings,
    LensSettings,
    LvfSettings,
    MonochromatorSettings,
    Part,
    ServoBoardSettings,
    TemperatureSettings,
)
from .boards.lcus import Answers
from .camera import BodySettings
from .faults import Fault, given
from .kinetics import KineticsSettings

#: Largest number of a relay of the Numato board.
RELAYS = 7
#: Place of a single sample without a region.
MIDDLE: Region = (0.1, 0.1, 0.8, 0.8)

#: Material of a place without a sample: dark, and without a glow.
EMPTY = "(no sample)"

#: A level below 1: only infinite light would reach 1 itself.
Charge = Annotated[float, Field(ge=0, lt=1)]


def _even(pixels: int) -> int:
    if pixels % 2:
        raise ValueError(f"expected an even number of pixels (a Bayer cell is 2 x 2), got {pixels}")
    return pixels


#: LibRaw refuses pictures smaller than 22 pixels.
Pixels = Annotated[int, Field(ge=32, le=8192), AfterValidator(_even)]


class Patch(Part):
    """A sample of one material on the table.

    Attributes
    ----------
    material
        Name of a shipped material, such as `blue-paint` or `yellow-textile`, or path of a material
        file or of a file with a re-radiation matrix.
    region
        Place of the sample in the frame: `[x, y, width, height]` in pixels, or all four as
        fractions of the frame.
    initial_charge
        Concentration r that a long charge under this room's lamp reaches, 0 to 1, instead of the
        one that follows from the excitation rates. Null: it follows from them, and is 0.5 for
        states without excitation rates. With `kinetics` it is that of traps of `depth_ev` at the
        surface.
    brightness
        Factor by which its glow is brighter than the material's file says.
    shape
        Shape of the sample: `flat`, or a `sphere` as large as fits into the region, lit from the
        left.
    kinetics
        How its traps fill and empty; null: by the rate equation of first order in a thin layer.
    prompt
        Fraction of the light absorbed where the sample is excited best that it re-radiates at once,
        in the colour of its glow, for example `5 %`; elsewhere in proportion to its excitation.
    """

    material: ShippedOrFile
    region: Region = MIDDLE
    brightness: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    shape: Literal["flat", "sphere"] = "flat"
    initial_charge: Charge | None = None
    kinetics: KineticsSettings | None = None
    prompt: Annotated[Fraction, Field(ge=0, le=1)] = 0.0


def _alone(sample: Any) -> Any:
    return [{"material": sample}] if isinstance(sample, str) else sample


#: Samples that lie side by side, or the name of a single material.
Patches = Annotated[
    tuple[Patch, ...],
    BeforeValidator(_alone, json_schema_input_type=str | tuple[Patch, ...]),
    NamesFile(or_shipped=True),
]


class ChangerPlace(Part):
    """A place of the sample changer.

    Attributes
    ----------
    pulse
        Length of the servo's pulse with this place in the light, for example `1300 us`.
    sample
        Samples on it: a list of patches, or the name of a single material.
    """

    pulse: Annotated[DurationS, Field(ge=64e-6, le=4080e-6)] = 1500e-6
    sample: Annotated[Patches, Field(min_length=1)]


class SampleChangerSettings(Part):
    """A disk or slide with samples, one of which is in the light; all others lie in the dark.

    Attributes
    ----------
    channel
        Channel of the Maestro at `sim://room/servo` that moves it, counted from 0; null: the lines
        `holder 1`, `holder 2`, … and `holder 0` at `sim://room/changer`, which answers `done`.
    travel
        Time that a turn takes, for example `1 s`; no sample is in the light meanwhile.
    places
        Places with samples. At any other pulse, and at `holder 0`, none is in the light.
    leak
        Light that reaches the samples that are not in place, as a fraction of that on the one that
        is, for example `1 %`.
    """

    channel: Annotated[int, Field(ge=0, le=23)] | None = None
    travel: Annotated[DurationS, Field(ge=0)] = 1.0
    places: Annotated[tuple[ChangerPlace, ...], Field(min_length=1)]
    leak: Annotated[Fraction, Field(ge=0, le=1)] = 0.0


class SensorSettings(Part):
    """The simulated camera's sensor.

    Attributes
    ----------
    width
        Width of the sensor in pixels, even.
    height
        Height of the sensor in pixels, even.
    flicker
        Standard deviation of the exposure from frame to frame, as a fraction, for example `0.7 %`.
    flicker_over
        Time over which the flicker of frames is alike, for example `30 s`: its correlation falls to
        1/e, as that of an AR(1) process. Null: every frame has a flicker of its own.
    ripple
        Amplitude of a sine in the sensor's gain, as a fraction, for example `0.7 %`, as a power
        supply or a regulated temperature makes it. Its phase follows from the seed.
    ripple_period
        Period of that sine, for example `5.1 s`.
    crosstalk
        Fraction of a pixel's charge that appears in each of its four neighbours instead.
    row_noise
        Standard deviation of the offset that all pixels of a row share, in multiples of a pixel's
        read noise.
    black_wander_dn
        Standard deviation of the black level, which wanders slowly, in DN.
    black_wander_over
        Time in which the black level wanders to another value, for example `10 min`.
    subtracts_black
        Whether the camera subtracts its black level before it writes the file, and cuts off at 0
        what noise has below it, as a Nikon D700.
    nonlinearity
        Fraction of the signal that is missing near saturation, for example `1 %`; of a smaller
        signal in proportion less.
    curves
        Spectral sensitivities of the simulated camera, a file in rawtoaces' format; null: those
        shipped of a Canon EOS 5D Mark II, changed by as much as laboratories disagree about them.
    """

    width: Pixels = 1404
    height: Pixels = 936
    flicker: Fraction = 0.007
    flicker_over: Annotated[DurationS, Field(gt=0)] | None = None
    ripple: Annotated[Fraction, Field(ge=0, le=0.5)] = 0.0
    ripple_period: Annotated[DurationS, Field(gt=0)] = 5.1
    crosstalk: Annotated[Fraction, Field(ge=0, le=0.2)] = 0.0
    row_noise: Annotated[Fraction, Field(ge=0)] = 0.0
    black_wander_dn: Annotated[float, Field(ge=0, le=100)] = 0.0
    black_wander_over: Annotated[DurationS, Field(gt=0)] = 600.0
    subtracts_black: bool = False
    nonlinearity: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0
    curves: ShippedOrFile | None = None


class LampSettings(Part):
    """The simulated halogen lamp.

    Attributes
    ----------
    irradiance
        Irradiance of the warm lamp, in multiples of that to which a material's k_e belong (with
        Table 1's norm: the length of the 8-band vector E). 4 puts r∞ of Table 1's materials between
        0.2 and 0.6.
    illuminance
        Illuminance of the sample by the warm, new lamp in lx, which gives the room its absolute
        scale: what a luxmeter would read there.
    warm_up
        Time constant with which housing and mirror become warm, and the light with them, for
        example `150 s`.
    warm_up_deficit
        Fraction of the light that is missing when the lamp is switched on cold, for example `3 %`.
    drift_per_hour
        Fraction of the light that is lost by ageing and dust in an hour of the room's clock, for
        example `0.2 %`.
    cooling_per_hour
        Fall of the burning filament's colour temperature in an hour of the room's clock, in K: the
        light becomes redder, at the same brightness at 560 nm. Negative: it becomes bluer.
    board
        Board that switches the lamp: `relays`, relay 0 of the Numato board, `lcus`, relay 1 of the
        LCUS board, or `arduino`, relay 0 of the Arduino, which then has the LEDs, too.
    afterglow
        Light of the lamp just after it is switched off, as a fraction of the burning lamp's, beside
        the cooling filament's.
    afterglow_fades
        Time constant with which the afterglow falls to 1/e, for example `60 s`.
    """

    irradiance: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 4.0
    illuminance: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1000.0
    warm_up: Annotated[DurationS, Field(gt=0)] = 150.0
    warm_up_deficit: Annotated[Fraction, Field(ge=0, lt=1)] = 0.03
    drift_per_hour: Annotated[Fraction, Field(ge=0, lt=1)] = 0.002
    cooling_per_hour: Annotated[float, Field(ge=-20, le=20)] = 0.0
    board: Literal["relays", "lcus", "arduino"] = "relays"
    afterglow: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0
    afterglow_fades: Annotated[DurationS, Field(gt=0)] = 60.0


class InitialState(Part):
    """State of the room at the epoch: after a crash, or with a sample that still glows.

    Attributes
    ----------
    lamp
        State of the lamp at the epoch: `off`, or `on` as a crash may have left it.
    leds
        Relays or outputs of the LEDs that are lit at the epoch, as a crash may have left them.
    door
        State of the trap door at the epoch: `closed` or `open`.
    concentration
        Concentration r of every excited state at the epoch, 0 to 1; above 0 the sample still glows.
    manual_steps
        Tasks that the changer has done before, for example `[lvf on sample]`.
    """

    lamp: Literal["off", "on"] = "off"
    leds: tuple[int, ...] = ()
    door: Literal["closed", "open"] = "closed"
    concentration: Annotated[float, Field(ge=0, le=1)] = 0.0
    manual_steps: tuple[str, ...] = ()


class Simulation(Part):
    """A simulated dark room.

    Attributes
    ----------
    sample
        Samples on the table: a list of patches, or the name of a single material, which then lies
        in the middle of the frame.
    sample_changer
        Sample changer, whose samples take the place of `sample`; null: none.
    initial_charge
        Concentration r that a long charge under this room's lamp reaches, 0 to 1, for patches that
        give none of their own.
    sensor
        Sensor of the camera.
    camera
        Body of the camera, and its settings that are made by hand.
    lens
        Lens of the camera; null: one of 75 mm that reports nothing.
    epoch
        Wall-clock time at which the room's clock stands at zero, with its time zone, for example
        `2026-01-01T00:00:00Z`.
    seed
        Seed of all random numbers: camera curves, hot pixels, noise.
    initial
        State of the room at the epoch.
    faults
        Faults of the room: names, or names with times, for example
        `[lamp_dead, {camera_unplugged: {at: 25 min, for: 20 s}}]`.
    lamp
        Properties of the halogen lamp.
    leds
        Narrow-band LEDs beside the lamp.
    led_board
        Board that switches the LEDs: `relays`, the Numato board, or the Arduino if that switches
        the lamp; `lcus`, the LCUS board; or `dc4100`, Thorlabs units at `sim://room/dc4100-1` to `sim://room/dc4100-3`.
    illuminants
        Broadband lamps, each on its relay of a Numato board of their own at `sim://room/lamps`.
    door
        Trap door: closed, the sample faces the lamp; open, the camera. Null: none, and the sample
        always faces both.
    shield
        Door before the lamp, open at first; null: none.
    servo
        Servo board that moves trap door and shield.
    lcus
        Answer of the LCUS board at `sim://room/lcus` to its query: `nothing`, lines of `text`, or
        `bytes`, one for each relay.
    lvf
        Linear variable filter; null: there is none.
    filters
        Folder with the colour filters' spectral transmittances, one file `NAME.csv` for each
        filter; null: the shipped folder.
    filter_wheel
        Filter wheel before the lamp; null: none.
    camera_filter_wheel
        Filter wheel before the camera; null: none.
    monochromator
        Monochromator that can be put between lamp and sample; null: none.
    filters_bent
        Root mean square by which the true transmittances differ from those of the files, for
        example `1 %`.
    grey_card
        Reflectance of the grey card, nearly the same at all wavelengths.
    grey_card_fluorescence
        Light below 430 nm that the grey card re-radiates about 440 nm, as a fraction of its power,
        for example `30 %`: an optical brightener.
    chart
        Place in the frame of a ColorChecker that the changer lays down: `[x, y, width, height]` in
        pixels, or all four as fractions of the frame.
    black_trap
        Place in the frame of a hole in the grey card from which no light comes back; null: none.
    ambient
        Irradiance at the sample of light that leaks into the room, as a fraction of the warm
        lamp's, for example `0.001 %`.
    temperature
        Temperature of the room; null: constant, and rates are those of the materials' files.
    anisotropy
        Fraction of its glow that a sample loses when it is turned away by 90 degrees, for example
        `5 %`.
    reradiation_anisotropy
        Fraction of its re-radiation that a fluorescent sample loses at 90 degrees, for example
        `10 %`: between light and camera, or on a sphere between the surface's normal and the
        camera.
    repositioning
        Standard deviation by which a sample's brightness changes when it is put in anew, for
        example `1 %`.
    gloss
        Fraction of the light that flat samples mirror into the camera where it stands in the
        direction of the mirrored light: with the light beside it. It fades towards other angles,
        and crossed polarisers take it away.
    light_deg
        Angle between LEDs and camera in degrees until the changer turns the light.
    polarisers
        Polarisers of the room: `crossed`, one before the LEDs and one, turned by 90 degrees, before
        the lens; null: none. Each absorbs ultraviolet and more than half of all other light.
    imaging
        Veiling glare and defocus of the lens, and texture of the surfaces.
    inter_reflection
        Irradiance of every surface by the light of all surfaces in the frame, over that of a dome
        as bright as they are on average, for example `2 %`.
    room_light
        Whether the room's own light is on while somebody aims through the viewfinder; photographs
        are always taken without it.
    """

    sample: Patches = ()
    sample_changer: SampleChangerSettings | None = None
    initial_charge: Charge | None = None
    sensor: SensorSettings = SensorSettings()
    camera: BodySettings = BodySettings()
    lens: LensSettings | None = None
    epoch: Annotated[AwareDatetime, Field(ge=datetime(1970, 1, 1, tzinfo=UTC))] = datetime(
        2026, 1, 1, tzinfo=UTC
    )
    seed: Annotated[int, Field(ge=0)] = 1
    initial: InitialState = InitialState()
    faults: tuple[Fault, ...] = ()
    lamp: LampSettings = LampSettings()
    leds: tuple[LedSettings, ...] = ()
    led_board: Literal["relays", "lcus", "dc4100"] = "relays"
    illuminants: tuple[IlluminantSettings, ...] = ()
    door: DoorSettings | None = None
    shield: DoorSettings | None = None
    servo: ServoBoardSettings = ServoBoardSettings()
    lcus: Answers = "nothing"
    lvf: LvfSettings | None = None
    filters: FilePath | None = None
    filter_wheel: FilterWheelSettings | None = None
    camera_filter_wheel: FilterWheelSettings | None = None
    monochromator: MonochromatorSettings | None = None
    filters_bent: Annotated[Fraction, Field(ge=0, le=0.2)] = 0.0
    grey_card: Annotated[Fraction, Field(gt=0, le=0.95)] = 0.18
    grey_card_fluorescence: Annotated[Fraction, Field(ge=0, le=1)] = 0.0
    chart: Region = MIDDLE
    black_trap: Region | None = None
    ambient: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0
    temperature: TemperatureSettings | None = None
    anisotropy: Annotated[Fraction, Field(ge=0, le=1)] = 0.0
    reradiation_anisotropy: Annotated[Fraction, Field(ge=0, le=1)] = 0.0
    repositioning: Annotated[Fraction, Field(ge=0, le=0.2)] = 0.0
    gloss: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0
    light_deg: Annotated[int, Field(ge=0, le=150)] = 45
    polarisers: Literal["crossed"] | None = None
    imaging: ImagingSettings = ImagingSettings()
    inter_reflection: Annotated[Fraction, Field(ge=0, le=0.5)] = 0.0
    room_light: bool = True

    @model_validator(mode="after")
    def _samples_on_a_table_or_a_changer(self) -> Self:
        if bool(self.sample) == (self.sample_changer is not None):
            raise ValueError("expected at least 1 value in 'sample', or a 'sample_changer'")
        return self

    @field_validator("faults")
    @classmethod
    def _one_camera_cable(cls, faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
        if len(given(fault.camera_unplugged for fault in faults)) > 1:
            raise ValueError("expected 'camera_unplugged' once: the simulated cable comes out once")
        return faults

    @model_validator(mode="after")
    def _what_can_fail(self) -> Self:
        if self.door is None and any(fault.door_stuck or fault.door_slow for fault in self.faults):
            raise ValueError("a fault of the door needs a 'door:'")
        if self.door and self.shield and self.door.channel == self.shield.channel:
            raise ValueError("expected 'door' and 'shield' on two channels of the servo board")
        if len({led.relay for led in self.leds}) < len(self.leds):
            raise ValueError("expected a relay of its own for each of 'leds'")
        leds = {led.relay for led in self.leds}
        spans = [span for fault in self.faults for span in (fault.led_dark, fault.led_stuck)]
        if (
            unknown := {*self.initial.leds, *(led.relay for led in given(spans) if led.relay)}
            - leds
        ):
            raise ValueError(f"expected relays of 'leds', got {min(unknown)}, which has no LED")
        if len({lamp.relay for lamp in self.illuminants}) < len(self.illuminants):
            raise ValueError("expected a relay of its own for each of 'illuminants'")
        if self.led_board == "relays" and any(led.relay > RELAYS for led in self.leds):
            raise ValueError(f"expected relays 1 to {RELAYS} for 'leds': the board has no more")
        if self.led_board == self.lamp.board == "lcus" and 1 in leds:
            raise ValueError("expected relays 2 to 8 for 'leds': relay 1 is the lamp's")
        if self.lvf is None and any(fault.lvf_turned for fault in self.faults):
            raise ValueError("a fault of the LVF needs an 'lvf:'")
        return self

    def opened_at(self, wall_s: float) -> Self:
        """Return the room opened at `wall_s`, seconds since 1970, if its epoch is earlier."""
        later_s = wall_s - self.epoch.timestamp()
        if later_s <= 0:
            return self
        return self.model_copy(
            update={
                "epoch": datetime.fromtimestamp(wall_s, UTC),
                "faults": tuple(fault.seen_from(later_s) for fault in self.faults),
                "temperature": self.temperature and self.temperature.later(later_s),
            }
        )

    @property
    def wall_at_opening_s(self) -> float:
        """Time of the PC's clock when the room is opened, in seconds since 1970."""
        ahead = given(fault.clock_ahead for fault in self.faults)
        back = given(fault.clock_back for fault in self.faults)
        return (
            self.epoch.timestamp()
            + sum(step.by for step in ahead if step.is_on(0.0))
            - sum(step.by for step in back if step.is_on(0.0))
        )

    def tables(self) -> tuple["Simulation", ...]:
        """Return the room with the samples of each place of the changer; only itself without one.

        The first has none of them in the light: an empty holder in the place of the first ones.
        """
        if self.sample_changer is None:
            return (self,)
        places = self.sample_changer.places
        empty = tuple(
            Patch(material=EMPTY, region=patch.region, brightness=1.0) for patch in places[0].sample
        )
        return tuple(
            self.model_copy(update={"sample": sample, "sample_changer": None})
            for sample in (empty, *(place.sample for place in places))
        )

    @property
    def patches(self) -> tuple[Patch, ...]:
        """The samples on the table, each with its charge resolved."""
        return tuple(
            patch.model_copy(update={"initial_charge": self.initial_charge})
            if patch.initial_charge is None
            else patch
            for patch in self.sample
        )
