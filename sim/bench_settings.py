"""Settings of the parts between lamp, sample and camera in a rig file's `simulation:`."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.foundation.models import FrozenModel
from labrig.foundation.named_files import FilePath
from labrig.foundation.quantity import DurationS, Fraction
from labrig.foundation.region import Region

#: Wavelengths of the ends of a strip.
Nanometres = Annotated[float, Field(ge=300, le=900)]


class Part(FrozenModel):
    """Part of a simulated room; never changes."""


class DoorSettings(Part):
    """A door that a servo swings by a quarter turn; the lamp's shield, closed, covers the lamp.

    Attributes
    ----------
    channel
        Channel of the Maestro at `sim://room/servo` that moves the door, counted from 0.
    closed
        Length of the servo's pulse with the door closed, for example `1000 us`.
    open
        Length of the servo's pulse with the door open, for example `2000 us`.
    travel
        Time that the whole way takes, after the servo's frame of up to 20 ms, for example `200 ms`.
    overshoot
        Swing of the door beyond its end, as a fraction of its way, for example `4 %`.
    ringing
        Time constant with which the ringing at the end falls to 1/e, for example `10 ms`.
    ringing_hz
        Frequency of the ringing in Hz.
    """

    channel: Annotated[int, Field(ge=0, le=23)] = 0
    closed: DurationS = 1000e-6
    open: DurationS = 2000e-6
    travel: Annotated[DurationS, Field(gt=0)] = 0.2
    overshoot: Annotated[Fraction, Field(ge=0, le=0.5)] = 0.04
    ringing: Annotated[DurationS, Field(gt=0)] = 0.01
    ringing_hz: Annotated[float, Field(gt=0)] = 25.0

    @model_validator(mode="after")
    def _two_ends(self) -> Self:
        if self.closed == self.open:
            raise ValueError("expected two different pulses for 'closed' and 'open'")
        return self


class LedSettings(Part):
    """An LED behind a relay, beside the lamp; no filter is before it.

    Attributes
    ----------
    relay
        Relay that switches the LED, of the board that `led_board` names; relay 0 is the lamp's. The
        outputs of the first DC4100 count as 1 to 4, of the second as 5 to 8, of the third as 9 to
        12.
    centre
        Wavelength of the strongest light of the cold LED, in nm.
    fwhm
        Full width at half maximum of the LED's band, in nm.
    asymmetry
        Width of the side of long wavelengths over that of the other.
    spectrum
        File with the LED's measured spectrum in two columns, wavelength_nm and a relative value,
        instead of `centre`, `fwhm` and `asymmetry`. Null: by these.
    level
        Irradiance of the cold LED as a fraction of the warm lamp's visible light, for example
        `10 %`.
    droop
        Fraction of the light that is lost when the LED has become warm, for example `3 %`.
    shift_nm
        Shift of the warm LED's spectrum to longer wavelengths, in nm.
    warm_up
        Time constant with which the lit LED warms, and cools again, for example `20 s`.
    """

    relay: Annotated[int, Field(ge=1, le=12)]
    centre: Nanometres
    fwhm: Annotated[float, Field(ge=5, le=200)] = 25.0
    asymmetry: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    spectrum: FilePath | None = None
    level: Annotated[Fraction, Field(gt=0)] = 0.1
    droop: Annotated[Fraction, Field(ge=0, lt=1)] = 0.0
    shift_nm: Annotated[float, Field(ge=-20, le=20)] = 0.0
    warm_up: Annotated[DurationS, Field(gt=0)] = 20.0


class FilterWheelSettings(Part):
    """A Thorlabs FW102C, before the lamp at `sim://room/wheel` or `…/camera-wheel` before a camera.

    Attributes
    ----------
    filters
        Name of the filter in each slot, from slot 1 on; null: an open slot. Slots that are not
        named are open.
    """

    filters: Annotated[tuple[str | None, ...], Field(min_length=1, max_length=6)]


class MonochromatorSettings(Part):
    """A monochromator between lamp and sample, an Oriel Cornerstone at `sim://room/monochromator`.

    The changer puts it there and takes it away.

    Attributes
    ----------
    fwhm
        Full width at half maximum of its slits' triangle in nm.
    off_nm
        Error of its wavelength scale in nm.
    level
        Transmittance at the blaze of its grating in the middle of the band.
    stray
        Stray light at all wavelengths as a fraction of that.
    """

    fwhm: Annotated[float, Field(ge=2, le=100)] = 20.0
    off_nm: Annotated[float, Field(ge=-10, le=10)] = 0.0
    level: Annotated[Fraction, Field(gt=0, le=1)] = 0.5
    stray: Annotated[Fraction, Field(ge=0, le=0.01)] = 1e-4


class IlluminantSettings(Part):
    """A broadband lamp on a relay of the Numato board at `sim://room/lamps`.

    Attributes
    ----------
    relay
        Relay that switches the lamp, counted from 0.
    kind
        What lights it: a filament (`halogen`), a `xenon` arc in a projector, a `daylight`
        simulator, or an `ultraviolet` black light.
    temperature
        Temperature of the filament in K.
    centre
        Wavelength of the strongest light of a black light, in nm.
    fwhm
        Full width at half maximum of a black light's band, in nm.
    level
        Irradiance of the warm lamp as a fraction of the warm halogen lamp's visible light.
    warm_up
        Time constant with which the lamp becomes warm, for example `60 s`.
    warm_up_deficit
        Fraction of the light that is missing when the lamp is cold, for example `10 %`.
    filter
        Name of the colour filter before it; null: none.
    """

    relay: Annotated[int, Field(ge=0, le=7)]
    kind: Literal["halogen", "xenon", "daylight", "ultraviolet"]
    temperature: Annotated[float, Field(ge=2000, le=3400)] = 2880.0
    centre: Nanometres = 366.0
    fwhm: Annotated[float, Field(ge=5, le=100)] = 17.0
    level: Annotated[Fraction, Field(gt=0)] = 0.3
    warm_up: Annotated[DurationS, Field(gt=0)] = 60.0
    warm_up_deficit: Annotated[Fraction, Field(ge=0, lt=1)] = 0.1
    filter: str | None = None


class ServoBoardSettings(Part):
    """The Maestro at `sim://room/servo`; its channels' homes are: door closed, shield open.

    Attributes
    ----------
    time_out
        Serial time-out after which the Maestro sends all channels home, for example `3 min`; null:
        none.
    """

    time_out: Annotated[DurationS, Field(gt=0)] | None = None


class StripSettings(Part):
    """Place in the frame of the LVF's strip, or of the light that it passes to the sample.

    Attributes
    ----------
    region
        Place of the strip in the frame as if it were not tilted, `[x, y, width, height]`; all
        around is its opaque holder.
    tilt
        Rotation of the strip about its middle in degrees, clockwise in the picture.
    rising
        Whether the wavelength rises from left to right.
    """

    region: Region
    tilt: Annotated[float, Field(ge=-20, le=20)] = 0.0
    rising: bool = True


class LvfSettings(Part):
    """The linear variable filter, and where it lies when the changer puts it in.

    Attributes
    ----------
    before_camera
        Place of the strip in the frame when the camera looks through the filter.
    on_sample
        Place of the strip in the frame when the filter is between lamp and sample.
    centre
        Wavelengths of the strip's blue and red end in nm, for example `[388, 712]`.
    bend_nm
        Deviation of the wavelength at the strip's middle from the straight line between its ends,
        in nm.
    fwhm_nm
        Full width at half maximum of the pass band in the middle of the strip, in nm; it grows with
        the wavelength.
    leakage
        Transmittance outside of the pass band, at all wavelengths, for example `0.1 %`.
    spread
        How far light below the filter reaches along the strip when it lies on the sample, by the
        lamp's penumbra and by scattering in the sample, 1 σ as a fraction of the strip's length,
        for example `0.5 %`.
    """

    before_camera: StripSettings = StripSettings(region=(0.06, 0.28, 0.88, 0.4), tilt=1.5)
    on_sample: StripSettings = StripSettings(region=(0.08, 0.3, 0.84, 0.4), tilt=-1.0, rising=False)
    centre: tuple[Nanometres, Nanometres] = (388.0, 712.0)
    bend_nm: float = 4.0
    fwhm_nm: Annotated[float, Field(ge=5, le=100)] = 25.0
    leakage: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.001
    spread: Annotated[Fraction, Field(ge=0, le=0.1)] = 0.0

    @model_validator(mode="after")
    def _rises(self) -> Self:
        blue, red = self.centre
        if red - blue < 5 * abs(self.bend_nm):
            raise ValueError(
                "expected 'centre' to rise from the blue end to the red one by five times 'bend_nm'"
            )
        return self


class LensSettings(Part):
    """The camera's lens.

    Attributes
    ----------
    name
        Name of the lens that the camera writes into its files, for example `EF75mm`; null: it
        writes nothing.
    focal_mm
        Focal length in mm, on a full-format body, 36 mm wide.
    uv_edge_nm
        Wavelength in nm at which its glass transmits half of the light; it absorbs what is shorter.
        Null: it absorbs as much as the camera's curves say.
    """

    name: Annotated[str, Field(pattern="^[ -~]+$")] | None = None
    focal_mm: Annotated[float, Field(ge=20, le=400)] = 75.0
    uv_edge_nm: Annotated[float, Field(ge=320, le=450)] | None = None

    @property
    def notes(self) -> tuple[str, float] | None:
        """Name and focal length in mm as the camera writes them into its files."""
        return None if self.name is None else (self.name, self.focal_mm)


class ImagingSettings(Part):
    """Imperfections that keep a photograph from being the scene; none unless given.

    Attributes
    ----------
    glare
        Veiling glare of the lens: fraction of the frame's mean light that lies evenly over all of
        it, of photographic lenses 0.3 % to 3 %.
    defocus_px
        Blur of the picture, 1 σ in pixels.
    texture
        Standard deviation of the brightness of surfaces from pixel to pixel, for example `3 %`. It
        moves with a sample that is put in anew.
    texture_px
        Size of the texture's grain, 1 σ in pixels.
    """

    glare: Annotated[Fraction, Field(ge=0, le=0.2)] = 0.0
    defocus_px: Annotated[float, Field(ge=0, le=50)] = 0.0
    texture: Annotated[Fraction, Field(ge=0, le=0.3)] = 0.0
    texture_px: Annotated[float, Field(ge=0, le=50)] = 1.0


class TemperatureSettings(Part):
    """Temperature of the room; re-radiation follows it with an activation energy of 0.65 eV.

    Attributes
    ----------
    start
        Temperature at the epoch in degrees Celsius; a material's rates belong to 21.
    drift_per_hour
        Rise of the temperature in degrees Celsius per hour; negative: it falls.
    """

    start: Annotated[float, Field(ge=0, le=45)] = 21.0
    drift_per_hour: Annotated[float, Field(ge=-10, le=10)] = 0.0

    def celsius(self, time_s: float) -> float:
        """Return the temperature at a time after the epoch, in degrees Celsius."""
        return self.start + self.drift_per_hour * time_s / 3600.0

    def later(self, seconds: float) -> Self:
        """Return the settings of a room that opens later by that time."""
        return self.model_copy(update={"start": self.celsius(seconds)})
