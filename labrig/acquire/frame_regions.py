"""Regions of interest of a protocol, and whether they lie inside the frames of a camera."""

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel

from labrig.foundation.errors import ProtocolError, UsageError
from labrig.foundation.region import LEAST_PIXELS, IsRegion, Region, region_pixels


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
        if width * height < LEAST_PIXELS:
            raise ProtocolError(
                f"{key}: expected a region of at least {LEAST_PIXELS} pixels, got {width} × "
                f"{height} of a frame of {frame_pixels[0]} × {frame_pixels[1]}; from fewer the "
                "noise cannot be estimated"
            )
