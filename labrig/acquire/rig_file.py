"""The rig file: driver, address and warm-up time of each device, and the optics of the bench."""

import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from labrig.acquire.roles import ROLES
from labrig.calibration import CalibrationKind, kinds
from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import RIG, require_kind
from labrig.foundation.models import FrozenModel
from labrig.foundation.named_files import FilePath, ShippedOrFile, is_path, with_absolute_paths
from labrig.foundation.plugins import DRIVERS, load
from labrig.foundation.quantity import DurationS, Fraction
from labrig.foundation.yaml_file import did_you_mean, read_yaml, validate


class CalibrationRules(FrozenModel):
    """Limits within which a kept calibration still holds.

    Attributes
    ----------
    find
        Whether calibrations that are kept beside the runs are used at all.
    at_most_age
        Age beyond which a calibration is too old, for example `720 h`.
    brightness
        Change of the card's brightness through the filter beyond which it no longer holds, for
        example `5 %`: the lamp aged or was moved, or the card is another one.
    colour
        Change of the lamp's light at 420 nm relative to that at 680 nm beyond which it no longer
        holds, for example `3 %`.
    shift_nm
        Shift of the filter before the camera in nm along the strip beyond which it no longer holds.
    unevenness
        Change at single wavelengths that neither brightness nor colour explain, beyond which it no
        longer holds, for example `4 %`: another card or another filter.
    only_warn
        Rules that only give a warning where they are broken.
    """

    find: bool = True
    at_most_age: DurationS = Field(720 * 3600.0, gt=0)
    brightness: Fraction = Field(0.05, gt=0, lt=1)
    colour: Fraction = Field(0.03, gt=0, lt=1)
    shift_nm: float = Field(2.0, gt=0, allow_inf_nan=False)
    unevenness: Fraction = Field(0.04, gt=0, lt=1)
    only_warn: tuple[
        Literal["age", "lens", "brightness", "colour", "shift_nm", "unevenness"], ...
    ] = ("age",)


#: Units of readings, each with the place at which it is taken.
UNITS = {"lx": "sample plane", "cd/m2": "card"}
_READING = re.compile(
    r"\s*(?P<number>\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*(?P<unit>lx|cd\s*/\s*m(?:2|²))\s*"
)

#: Kinds of lamps by which standards excite, and others that a bench may have.
LampType = Literal["xenon", "D65 fluorescent", "fluorescent", "halogen", "LED", "daylight", "other"]


class LuminanceReading(FrozenModel):
    """One reading of a luxmeter or a luminance meter under the bare, warm lamp of the bench.

    Attributes
    ----------
    value
        Reading with its unit: an illuminance such as `312 lx`, or the luminance of the lit grey
        card such as `95 cd/m2`.
    sigma
        Relative standard uncertainty of the reading by the meter's calibration, for example `3 %`.
    at
        Place of the meter: `sample plane` for an illuminance, `card` for a luminance.
    lamp
        Kind of the lamp: `xenon`, `D65 fluorescent`, `fluorescent`, `halogen`, `LED`, `daylight` or
        `other`. Default: not stated, which accords with no standard.
    spectrum
        Spectrum of the lamp at the sample: name of a shipped file or path of a file. Default: that
        of `lamp` under `optics:`.
    f1_prime
        General mismatch index f1′ of the meter, for example `5 %`. Default: not stated.
    """

    value: str = Field(coerce_numbers_to_str=True)
    sigma: Fraction = Field(gt=0, lt=1)
    at: Literal["sample plane", "card"]
    lamp: LampType | None = None
    spectrum: ShippedOrFile | None = None
    f1_prime: Fraction | None = Field(None, ge=0, lt=1)

    @model_validator(mode="after")
    def _unit_of_its_place(self) -> Self:
        match = _READING.fullmatch(self.value)
        if match is None or not float(match["number"]) > 0:
            raise ValueError(
                "value: expected a reading above 0 with its unit, such as '312 lx' or '95 cd/m2', "
                f"got '{self.value}'"
            )
        unit = "lx" if match["unit"] == "lx" else "cd/m2"
        if UNITS[unit] != self.at:
            raise ValueError(
                f"expected lx at the sample plane or cd/m2 at the card, got {unit} at: {self.at}"
            )
        return self

    @cached_property
    def number(self) -> float:
        """Reading in lx at the sample plane, in cd/m² at the card."""
        match = _READING.fullmatch(self.value)
        assert match is not None
        return float(match["number"])


ModelT = TypeVar("ModelT", bound=BaseModel)

#: Difference in degrees between the angles of light and camera, on opposite sides of the surface's
#: normal, from which a surface's gloss does not reach the camera.
GLOSS_DEG = 30.0
#: Largest angle of light or camera against the normal.
MAX_DEG = 85


class DeviceEntry(BaseModel):
    """One device; further keys belong to its driver and are validated by the driver's model.

    Attributes
    ----------
    driver
        Name of the device's driver, which decides what the other keys are, for example
        `numato`.
    address
        Address of the device: a serial port (`COM3`, `/dev/ttyACM0`, `/dev/cu.usbmodem…`), a USB
        device (`usb://04a9:3199`, with `/SERIAL` behind it if there are two alike), a network
        camera (`ptpip://host`), a serial board behind a network (`socket://host:port`), a video
        device (`uvc://0`), or a device of the simulated room (`sim://room/relays`).
    warm_up
        Time after connecting, or for a lamp after switching on, until the device is steady, for
        example `15 min`. A lamp's warm-up time is part of the charge. Default: none.
    """

    model_config = ConfigDict(frozen=True, extra="allow")

    driver: str
    address: str
    warm_up: DurationS = 0.0

    def settings(self) -> dict[str, Any]:
        """Return the keys that belong to the driver."""
        return dict(self.__pydantic_extra__ or {})

    def addresses(self) -> list[str]:
        """Return all addresses of the device: its own, and those under keys `address` within."""
        return [self.address, *_addresses_within(self.settings())]


def _addresses_within(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for key, inner in value.items():
            if key == "address" and isinstance(inner, str):
                yield inner
            else:
                yield from _addresses_within(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _addresses_within(inner)


def _with_calibrations(model: type[ModelT]) -> type[ModelT]:
    """Return the model with a key for each kind of calibration."""
    keys: dict[str, Any] = {
        kind.optics_key: (
            FilePath | None,
            Field(
                None, description=f"Result of {kind.protocol}: its file, or the folder of its run."
            ),
        )
        for kind in kinds()
    }
    return create_model(model.__name__, __base__=model, __doc__=model.__doc__, **keys)


@_with_calibrations
class Optics(FrozenModel):
    """Measured curves and calibrations of the bench; see `CalibrationKind` for the latter.

    Attributes
    ----------
    camera
        Spectral sensitivities of the camera: name of a shipped file, such as
        `canon_eos_5d_mark_ii`, path of a file, or folder of the run of protocol `camera_curves`
        that estimated them. Default: the shipped file of the model that the camera says it is, if
        there is one.
    lamp
        Spectrum of the lamp: name of a shipped file, such as `halogen_3000k`, or path of a file.
    grey_card
        Spectral reflectance of the grey card: name of a shipped file, such as `grey_card_18`, or
        path of a file.
    filters
        Folder with the colour filters' spectral transmittances, one file `NAME.csv` for each
        filter. Default: the shipped folder.
    geometry
        Angles of LEDs and camera against the normal of a flat sample, on opposite sides of it, in
        whole degrees, such as `45/0`. What comes back there is a radiance factor, and it is without
        gloss if the angles differ by 30° or more. Default: unknown.
    lens
        Spectral transmittance of the camera's lens, where the curves under `camera` were measured
        without one: name of a shipped file, such as `photographic_lens`, or path of a file.
        Default: the curves are those of camera and lens.
    polarisers
        Polarisers of the bench: `crossed`, one before the LEDs and one, turned by 90 degrees,
        before the lens, so that no gloss reaches the camera. Default: none.
    polariser
        Spectral transmittance of one of these polarisers: path of a file. Default: the same at all
        wavelengths.
    emission_library
        Measured emissions that dyes of fluorescent samples may have: a folder of re-radiation
        matrices or of tables of spectra, or one such file.
    luminance
        Reading of a luxmeter at the sample or of a luminance meter on the card, under the bare
        lamp, for example `{value: 312 lx, sigma: 3 %, at: sample plane, lamp: halogen}`. The
        protocol `luminance` needs it.
    direct
        Run of the protocol `direct_bispectral` on samples of the same names, with which estimated
        re-radiation is compared.
    camera_file
        Camera calibration: its file `camera.yaml`, or the folder of the run of protocol
        `camera_calibration` that measured it.
    lvf
        Calibration of the linear variable filter: its file `lvf.yaml`, or the folder of the run of
        protocol `lvf_calibration` that measured it.
    irradiance
        Irradiance of the lamp at the sample: its file `irradiance.yaml`, or the folder of the run
        of protocol `irradiance` that measured it.
    fade
        Turn-off and turn-on transient of the lamp: its file `fade.yaml`, or the folder of the run
        of protocol `fade` that measured it.
    leds
        Spectra and brightnesses of the LEDs: their file `leds.yaml`, or the folder of the run of
        protocol `led_brightness` that measured them.
    reflectance
        Albedo and total radiance factor of samples: their file `reflectance.yaml`, or the folder of
        the run of protocol `reflectance` that measured them.
    reference
        Bench to which calibrations belong: its file `reference.yaml`, or the folder of the run of
        protocol `calibration` that measured it.
    blank
        Background and stray light of the bench after lamp off: its file `blank.yaml`, or the folder
        of the run of protocol `blank` that measured it.
    """

    camera: ShippedOrFile | None = None
    lamp: ShippedOrFile | None = None
    grey_card: ShippedOrFile | None = None
    filters: FilePath | None = None
    geometry: Annotated[str, Field(pattern=r"^\d{1,2}/\d{1,2}$")] | None = None
    lens: ShippedOrFile | None = None
    polarisers: Literal["crossed"] | None = None
    polariser: FilePath | None = None

    @model_validator(mode="after")
    def _parts_fit(self) -> Self:
        if self.geometry is not None and max(map(int, self.geometry.split("/"))) > MAX_DEG:
            raise ValueError(
                f"geometry: expected angles up to {MAX_DEG} degrees against the normal, such "
                f"as 45/0, got {self.geometry}"
            )
        if self.polariser is not None and self.polarisers is None:
            raise ValueError("expected 'polarisers: crossed' with the curve of a 'polariser'")
        return self

    @property
    def angles_deg(self) -> tuple[int, int] | None:
        """Angles of LEDs and camera against the normal in degrees; None if they are unknown."""
        if self.geometry is None:
            return None
        light, camera = map(int, self.geometry.split("/"))
        return light, camera

    @property
    def may_see_gloss(self) -> bool:
        """Whether a surface's gloss is known to reach the camera."""
        if self.angles_deg is None or self.polarisers is not None:
            return False
        light, camera = self.angles_deg
        return abs(light - camera) < GLOSS_DEG

    @property
    def geometry_text(self) -> str:
        """Geometry and polarisers, such as `45°/0°, crossed polarisers`; empty if unknown."""
        angles = () if self.angles_deg is None else ("/".join(f"{at}°" for at in self.angles_deg),)
        polarised = () if self.polarisers is None else ("crossed polarisers",)
        return ", ".join((*angles, *polarised))

    emission_library: FilePath | None = None
    direct: FilePath | None = None
    luminance: LuminanceReading | None = None

    def filter_files(self) -> dict[str, Path]:
        """Return the files of the colour filters' transmittances by name.

        They are in the rig's own folder if it names one, else in the shipped one.

        Raises
        ------
        UsageError
            If the folder has no such file.
        """
        shipped = resources.folder("config/optics/filters")
        folder = shipped if self.filters is None else Path(self.filters)
        files = {path.stem: path for path in sorted(folder.glob("*.csv"))}
        if not files:
            raise UsageError(
                f"{folder}: expected a table NAME.csv for every colour filter, found none; see "
                f"{shipped} for an example, and 'filters' under 'optics:'"
            )
        return files

    def named(self, kind: CalibrationKind[Any]) -> str | None:
        """Return the file or run folder named as a calibration of a kind; None if there is none."""
        name: str | None = getattr(self, kind.optics_key)
        return name


class RigFile(FrozenModel):
    """Content of a rig file.

    Attributes
    ----------
    name
        Name of the bench, for reports and messages, for example `dark room`.
    devices
        Devices of the bench, each under the key of its role, such as `lamp` or `camera`.
    optics
        Spectral curves of the bench's parts, and its calibrations.
    calibrations
        Limits within which calibrations that are kept beside the runs still hold.
    on_finish
        What happens when a run has ended: `bell` rings the terminal's bell, a list of words is a
        command to start, for example `[notify-send, labrig]`. Default: nothing.
    simulation
        Content of the simulated dark room, for a rig file whose devices have addresses
        `sim://room/…`. Default: none, the devices are real.
    """

    name: str
    devices: dict[str, DeviceEntry] = Field(min_length=1)
    optics: Optics = Optics()
    calibrations: CalibrationRules = CalibrationRules()
    on_finish: Literal["bell"] | tuple[str, ...] | None = Field(
        None, description="when a run has ended: bell, or a command as a list of words"
    )
    simulation: dict[str, Any] | None = Field(
        None, description="only in a simulated rig: what is in the simulated room"
    )

    def addresses(self) -> list[str]:
        """Return the addresses of all devices."""
        return [each for entry in self.devices.values() for each in entry.addresses()]


def read_rig_file(path: str | Path) -> RigFile:
    """Read and validate a rig file, except the keys that belong to its drivers.

    Paths of files that it names are relative to its own folder, and absolute in the result, so that
    this can be written elsewhere; those of a simulated room are the bench's business.

    Parameters
    ----------
    path
        Rig file in YAML.

    Returns
    -------
    RigFile
        Devices, optics and, for a simulated rig, the simulated room.

    Raises
    ------
    UsageError
        If the file cannot be read, or a key is missing, unknown or invalid; the message names both.

    Examples
    --------
    >>> import labrig
    >>> rig = labrig.read_rig_file("runs/decay/rig.yaml")
    >>> rig.name
    'simulated dark room with LVF'
    >>> rig.devices["lamp"].driver, rig.optics.camera
    ('numato', 'canon_eos_5d_mark_ii')
    """
    path = Path(path)
    require_kind(path, RIG)
    return rig_of(read_yaml(path), path)


def rig_of(content: Mapping[str, Any], path: Path) -> RigFile:
    """Return the rig with the content of the file at `path`, as `read_rig_file` does."""
    folder = path.resolve().parent
    content = with_absolute_paths(content, RigFile, folder)
    if isinstance(devices := content.get("devices"), dict):
        content["devices"] = {
            key: _device_with_absolute_paths(key, entry, folder) for key, entry in devices.items()
        }
    rig = validate(content, RigFile, str(path))
    for key in rig.devices:
        if key not in ROLES:
            raise UsageError(
                f"{path}: unknown device '{key}' under 'devices'; {did_you_mean(key, list(ROLES))}"
            )
    return rig


def _device_with_absolute_paths(key: str, entry: Any, folder: Path) -> Any:
    """Return a device's keys with absolute paths where its driver's settings name files."""
    if not isinstance(entry, dict) or not isinstance(name := entry.get("driver"), str):
        return entry
    keys = {each: value for each, value in entry.items() if each not in DeviceEntry.model_fields}
    if not _has_path(keys) or key not in ROLES:
        return entry  # nor is its driver needed yet
    try:
        driver = ROLES[key].driver(load(DRIVERS, name, ""))
    except UsageError:  # told where it is needed
        return entry
    if driver is None:
        return entry
    return entry | with_absolute_paths(keys, driver.Settings, folder)


def _has_path(value: Any) -> bool:
    if isinstance(value, dict):
        return any(map(_has_path, value.values()))
    if isinstance(value, list):
        return any(map(_has_path, value))
    return isinstance(value, str) and is_path(value)
