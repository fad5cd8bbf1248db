"""Base of all protocols: a YAML file as a frozen model that lists its units and regions."""

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, field_validator

from labrig.acquire.adaptation import Adaptation, adapted
from labrig.acquire.rig import Rig
from labrig.acquire.rig_file import RigFile
from labrig.acquire.session import Session
from labrig.acquire.values import CameraCapabilities
from labrig.calibration import CalibrationKind
from labrig.foundation.errors import ProtocolError, UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import LengthMm, MassPerArea
from labrig.foundation.region import MIN_PIXELS, IsRegion, Region, region_pixels
from labrig.record import FrameRole, unit_in


def regions_in(model: BaseModel) -> dict[str, Region]:
    """Return the regions among the values of a model by their keys, such as `patches.sample`."""
    regions: dict[str, Region] = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if value is None or not _names_regions((field.annotation, *field.metadata)):
            continue
        if isinstance(value, Mapping):
            regions |= {f"{name}.{patch}": region for patch, region in value.items()}
        else:
            regions[name] = value
    return regions


def _names_regions(annotation: tuple[Any, ...]) -> bool:
    """Return whether a type is a region or holds some; an annotated one has its metadata behind."""
    return any(
        isinstance(part, IsRegion) or _names_regions(get_args(part))
        for part in annotation
        if part is not None
    )


def require_inside(regions: Mapping[str, Region], frame_pixels: tuple[int, int]) -> None:
    """Refuse regions that extend beyond a frame, or have too few pixels to estimate their noise.

    Parameters
    ----------
    regions
        Regions by their keys in the protocol.
    frame_pixels
        Width and height of the camera's frames in pixels.

    Raises
    ------
    ProtocolError
        A region is not inside, or too small; the message names its key and the frame's size.
    """
    for key, region in regions.items():
        try:
            _, _, width, height = region_pixels(region, *frame_pixels)
        except UsageError as error:
            raise ProtocolError(f"{key}: {error}") from None
        if width * height < MIN_PIXELS:
            raise ProtocolError(
                f"{key}: expected a region of at least {MIN_PIXELS} pixels, got {width} × "
                f"{height} of a frame of {frame_pixels[0]} × {frame_pixels[1]}; from fewer the "
                "noise cannot be estimated"
            )


class Unit(Protocol):
    """A part of a run that is either complete or repeated: one charge and decay, one filter."""

    @property
    def name(self) -> str:
        """Name of the unit, unique within the protocol and the same in every run of it."""

    def run(self, session: Session) -> None:
        """Run the unit to its end, or raise an exception."""


class Sample(BaseModel):
    """Description of the sample on the bench, for the record.

    Attributes
    ----------
    name
        Name of the sample, which the material file takes over, for example `blue-paint`.
    thickness
        Thickness of the layer, for example `0.4 mm`, which the material file takes over. Several
        patches count as equally thick.
    max_optical_density
        Largest decadic optical density that the layer may have in the light that it absorbs most,
        for example `0.05`, as a spectrometer measured it or as you are sure of it. It bounds what
        the thickness may do to excitation rates. Several patches share it.
    mass_per_area
        Mass of the phosphor per area, for example `300 g/m2`, which the material file takes over.
    batch
        Batch or lot of the sample as free text, for example `B-17`. It is recorded, not used.
    last_light
        When the sample last saw light, and which, as free text, for example
        `daylight, yesterday evening`.
    notes
        Anything else worth keeping about the sample, as free text.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", coerce_numbers_to_str=True)

    name: str = Field("sample", min_length=1)
    thickness: Annotated[LengthMm, Field(gt=0)] | None = None
    max_optical_density: Annotated[float, Field(gt=0, le=4)] | None = None
    mass_per_area: Annotated[MassPerArea, Field(gt=0)] | None = None
    batch: str | None = None
    last_light: str | None = Field(None, description="when and which light it saw last")
    notes: str | None = None


class ProtocolModel(FrozenModel):
    """Base of the protocols' models; a YAML file names its model in `protocol:`.

    Attributes
    ----------
    protocol
        Name of the protocol, which decides what the other keys are, for example `decay`.
    sample
        Description of the sample, for the record.
    """

    #: Kinds of calibrations on which the results depend.
    requires: ClassVar[tuple[CalibrationKind[Any], ...]] = ()
    #: Keys of `optics:` without whose curves a run is recorded, and cannot be processed.
    curves: ClassVar[tuple[str, ...]] = ()
    #: Whether calibrations that are kept beside the runs are used; not by what measures them anew.
    uses_calibrations: ClassVar[bool] = True

    protocol: str
    sample: Sample = Sample()

    @field_validator("sample", mode="before")
    @classmethod
    def _sample_with_keys(cls, sample: Any) -> Any:
        if not isinstance(sample, (dict, Sample)):
            received = ", got a list" if isinstance(sample, list) else ""
            raise ValueError(f"expected keys, such as 'sample: {{name: blue-paint}}'{received}")
        return sample

    @property
    def rate_frames(self) -> Collection[str]:
        """Roles of the frames to which rates are fitted; the rates belong to their temperature."""
        return (FrameRole.DECAY,)

    @property
    def picture_frames(self) -> Collection[str]:
        """Roles of the frames that show the sample, the best first, for its small picture."""
        return (*self.rate_frames, FrameRole.DAYLIGHT)

    @property
    def sample_in_place(self) -> str | None:
        """Name of the sample that is in place during the run; None if units bring their own."""
        return self.sample.name

    @abstractmethod
    def units(self) -> Sequence[Unit]:
        """Return all units in order; they are determined before any device moves."""

    def patches_of(self, unit: str) -> Mapping[str, Region]:
        """Return the regions of interest of a unit's frames by name; empty for most protocols."""
        patches: Mapping[str, Region] = getattr(self, "patches", {})
        return patches

    def apertures(self) -> Set[float]:
        """Return the f-numbers of the frames; empty for a lens that does not tell them."""
        f_number = getattr(getattr(self, "camera", None), "f_number", None)
        return set() if f_number is None else {f_number}

    def named_regions(self) -> Mapping[str, Region]:
        """Return all regions of the frame that the protocol names, by their keys."""
        return regions_in(self)

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the protocol with the values that it takes from the rig file; the base takes none.

        Raises
        ------
        UsageError
            If the rig file names a file or folder that does not exist.
        """
        return self

    def adapted_to(
        self, rig: Rig, chosen: Collection[str] | None = None
    ) -> tuple[Self, Sequence[Adaptation]]:
        """Return the protocol with all values that nobody chose among those of a rig; and which.

        Parameters
        ----------
        rig
            Open devices, or stand-ins of a plan.
        chosen
            Dotted keys whose values a person chose; None: those that the protocol's file sets.

        Raises
        ------
        ProtocolError
            The rig does not offer a value that was chosen.
        """
        return adapted(self, rig, chosen)

    def frame_spacing(self, capabilities: CameraCapabilities) -> Sequence[str]:
        """Return how repeated frames are spaced in time, in lines for a plan; mostly none."""
        return ()

    def notes(self, rig: RigFile) -> Sequence[str]:
        """Return what a person should know of this protocol on a rig before a run, a line each."""
        return ()

    def unnamed_curves(self, rig: RigFile) -> Mapping[str, Sequence[str]]:
        """Return the curves that the results need and the rig file does not name.

        Those of colour filters that are shipped are invented ones, for simulated rigs.

        Returns
        -------
        dict of str to sequence of str
            Protocols that need a curve, by its key under `optics:`.
        """
        return {
            key: (self.protocol,)
            for key in self.curves
            if getattr(rig.optics, key) is None
            and not (key == "filters" and rig.simulation is not None)
        }

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols whose results this one needs and the rig file does not name."""
        return [kind.protocol for kind in self.requires if rig.optics.named(kind) is None]


@dataclass(frozen=True)
class PartUnit:
    """A unit of a protocol that is one part of a chain.

    Attributes
    ----------
    part
        Name of the part.
    unit
        Unit within the part.
    """

    part: str
    unit: Unit

    @property
    def name(self) -> str:
        """Name of the unit in the chain, such as `decay/decay-1`."""
        return unit_in(self.part, self.unit.name)

    def run(self, session: Session) -> None:
        """Run the unit in a session that shows only the frames of its own part."""
        self.unit.run(session.within(self.part))
