"""What a result was made with: labrig, the libraries its numbers pass through, what was asked."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version

from pydantic import BaseModel, ConfigDict

from labrig.analyse.choices import Choices, DecayProtocol
from labrig.analyse.timed_frames import IntactFrames
from labrig.record import FrameRecord
from labrig.region import Region

_LIBRARIES = ("numpy", "scipy", "nlopt", "rawpy", "matplotlib", "colour-science", "h5py")


class StageProvenance(BaseModel):
    """`provenance.yaml` of a result: the same in all of these gives the same result.

    Attributes
    ----------
    labrig, libraries
        Versions.
    frames
        How many went in, by purpose.
    excluded
        Names of the frames a person left out.
    optics
        Calibrations that a person named instead of the rig file's.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    labrig: str
    libraries: dict[str, str]
    frames: dict[str, int]
    excluded: tuple[str, ...]
    optics: dict[str, str] = {}


class ResultProvenance(StageProvenance):
    """Of a decay: what was used besides, whoever asked for it; the camera by its curves' name."""

    patches: dict[str, Region]
    background: Region | None
    states: str | int
    fixed_rates_per_s: tuple[float, ...]
    camera: str | None


def provenance(
    protocol: DecayProtocol,
    choices: Choices,
    patches: Mapping[str, Region],
    background: Region | None,
    frames: IntactFrames,
    recorded: Sequence[FrameRecord],
    camera: str | None,
) -> ResultProvenance:
    """Gather it; `recorded` are all frames there are."""
    excluded = tuple(frame.path.name for frame in recorded if choices.excludes(frame))
    return ResultProvenance(
        labrig=version("labrig"),
        libraries=library_versions(),
        patches=dict(patches),
        background=background,
        states=choices.states or protocol.states,
        fixed_rates_per_s=choices.fixed_rates_per_s,
        camera=camera,
        frames={
            "decay": sum(frame.path.name not in excluded for frame in frames.decay),
            "dark": len(frames.dark),
        },
        excluded=excluded,
        optics=dict(choices.optics),
    )


@cache
def library_versions() -> dict[str, str]:
    """Versions of what decodes, reduces, fits and draws."""
    import cv2
    import rawpy

    installed = {name: version(name) for name in _LIBRARIES}
    # OpenCV comes as one of several packages, LibRaw inside rawpy.
    libraw = ".".join(map(str, rawpy.libraw_version))
    return {**installed, "opencv": cv2.__version__, "libraw": libraw}
