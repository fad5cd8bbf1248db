"""The `simulation:` section of a rig file: what stands in the simulated dark room."""

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

from labrig.quantity import DurationS, Fraction
from labrig.region import Region

from .bench_settings import (
    DoorSettings,
    LedSettings,
    LensSettings,
    LvfSettings,
    Part,
    ServoBoardSettings,
    TemperatureSettings,
)
from .boards.lcus import Answers
from .camera import BodySettings
from .faults import Fault, given

#: Where one sample lies when no region is given.
MIDDLE: Region = (0.1, 0.1, 0.8, 0.8)

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
        Material file, or shipped name.
    region
        Where the camera sees it, see `labrig.region`.
    initial_charge
        Level r that a long charge under this room's lamp reaches, given instead of computed from
        the excitation rates. Null: computed; 0.5 for states without excitation rates.
    """

    material: str
    region: Region = MIDDLE
    initial_charge: Charge | None = None


class SensorSettings(Part):
    """The simulated camera's sensor.

    Attributes
    ----------
    flicker
        1 σ scatter of all light between frames.
    crosstalk
        Fraction of a pixel's charge that shows in each of its four neighbours instead.
    row_noise
        1 σ of what reading a row adds to all of its pixels, in multiples of a pixel's read noise.
    curves
        The camera's spectral sensitivity, a file in rawtoaces' format; null: the shipped one of a
        Canon EOS 5D Mark II, bent by as much as laboratories disagree about it.
    """

    width: Pixels = 1404
    height: Pixels = 936
    flicker: Fraction = 0.007
    crosstalk: Annotated[Fraction, Field(ge=0, le=0.2)] = 0.0
    row_noise: Annotated[Fraction, Field(ge=0)] = 0.0
    curves: str | None = None


class LampSettings(Part):
    """The simulated halogen lamp.

    Attributes
    ----------
    irradiance
        Of the warm lamp, in multiples of the irradiance to which a material's k_e belong (with
        Table 1's norm: the length of the 8-band vector E). 4 puts r∞ of Table 1's between 0.2
        and 0.6.
    warm_up
        Time constant with which housing and mirror warm, and the light with them.
    warm_up_deficit
        Light missing when switched on cold.
    drift_per_hour
        Light lost by ageing and dust, per hour of the room's clock.
    board
        The board that switches it: relay 0 of `relays` (Numato), or relay 1 of `lcus`.
    afterglow
        Light that stays behind when it is switched off, of the burning lamp's.
    afterglow_fades
        Time in which that falls to 1/e.
    """

    irradiance: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 4.0
    warm_up: Annotated[DurationS, Field(gt=0)] = 150.0
    warm_up_deficit: Annotated[Fraction, Field(ge=0, lt=1)] = 0.03
    drift_per_hour: Annotated[Fraction, Field(ge=0, lt=1)] = 0.002
    board: Literal["relays", "lcus"] = "relays"
    afterglow: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0
    afterglow_fades: Annotated[DurationS, Field(gt=0)] = 60.0


class InitialState(Part):
    """How the room is found at the epoch: what a crash left behind, a sample that still glows.

    Attributes
    ----------
    manual_steps
        What the changer has done before, such as `lvf on sample`.
    """

    lamp: Literal["off", "on"] = "off"
    door: Literal["closed", "open"] = "closed"
    concentration: Annotated[float, Field(ge=0, le=1)] = 0.0
    manual_steps: tuple[str, ...] = ()


def _alone(sample: Any) -> Any:
    return [{"material": sample}] if isinstance(sample, str) else sample


class Simulation(Part):
    """A simulated dark room.

    Attributes
    ----------
    sample
        The patches; in YAML also the name of a single material, in the middle of the frame.
    initial_charge
        As `Patch.initial_charge`, for patches that do not say.
    camera
        Which body the camera has, and how somebody has set it.
    lens
        Its lens; null: one of 75 mm that tells nothing.
    epoch
        Wall-clock time at which the room's clock stands at zero.
    seed
        Of everything random: camera curves, hot pixels, noise.
    faults
        What goes wrong, and when, see `sim.faults`.
    leds
        The bank of LEDs.
    door
        The trap door: closed, the sample faces the lamp, open, the camera. Null: none, and the
        sample always faces both.
    shield
        A door before the lamp, open at first; null: none.
    servo
        The board that moves both.
    lcus
        What the LCUS board at `sim://room/lcus` says to its query.
    lvf
        The linear variable filter; null: there is none.
    filters
        Folder of the colour filters' transmittances, a file each, named by its stem; null: the
        shipped one.
    filters_bent
        By which they really differ from that, root mean square.
    grey_card
        Reflectance of the grey card, nearly the same at all wavelengths.
    chart
        Where the camera sees a ColorChecker that the changer lays down.
    ambient
        Light that leaks into the room, of the warm lamp's at the sample.
    temperature
        Of the room; null: such that rates are what the materials' files say.
    anisotropy
        Part of its glow that a sample loses when it is turned away by 90 degrees.
    room_light
        Whether the room's own light is on while somebody aims through the viewfinder; photographs
        are always taken without it.
    """

    sample: Annotated[
        tuple[Patch, ...],
        BeforeValidator(_alone, json_schema_input_type=str | tuple[Patch, ...]),
        Field(min_length=1),
    ]
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
    door: DoorSettings | None = None
    shield: DoorSettings | None = None
    servo: ServoBoardSettings = ServoBoardSettings()
    lcus: Answers = "nothing"
    lvf: LvfSettings | None = None
    filters: str | None = None
    filters_bent: Annotated[Fraction, Field(ge=0, le=0.2)] = 0.0
    grey_card: Annotated[Fraction, Field(gt=0, le=0.95)] = 0.18
    chart: Region = MIDDLE
    ambient: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0
    temperature: TemperatureSettings | None = None
    anisotropy: Annotated[Fraction, Field(ge=0, le=1)] = 0.0
    room_light: bool = True

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
        if self.lvf is None and any(fault.lvf_turned for fault in self.faults):
            raise ValueError("a fault of the LVF needs an 'lvf:'")
        return self

    def opened_at(self, wall_s: float) -> Self:
        """The same room opened at `wall_s`, seconds since 1970, if its epoch is earlier."""
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
        """What the PC's clock says when the room is opened, seconds since 1970."""
        ahead = given(fault.clock_ahead for fault in self.faults)
        back = given(fault.clock_back for fault in self.faults)
        return (
            self.epoch.timestamp()
            + sum(step.by for step in ahead if step.is_on(0.0))
            - sum(step.by for step in back if step.is_on(0.0))
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
