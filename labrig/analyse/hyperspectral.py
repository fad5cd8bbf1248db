"""A re-radiation matrix from hyperspectral images of a sample, one for each narrow-band light.

A white reference of known reflectance tells what each light is. It lies beside the sample in the
same image, or in the sample's place in another one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.fit import IlluminatedSpectrum, bispectral_columns
from labrig.fit.bispectral import BispectralColumns, light_window_nm, separate_columns
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.region import MIN_PIXELS, Region, region_pixels
from labrig.optics import (
    HyperspectralCube,
    Transmittance,
    read_hyperspectral_cube,
    read_transmittance,
)
from labrig.results import DirectColumns, Measured


def direct_columns(
    lights: Sequence[str], columns: BispectralColumns, drift: Measured
) -> DirectColumns:
    """Return columns with reflected and re-radiated light taken apart; `lights` in their order."""
    separated = separate_columns(columns)
    return DirectColumns(
        lights=tuple(lights),
        input_nm=columns.light_nm,
        output_nm=columns.output_nm,
        column=columns.column,
        column_sigma=columns.column_sigma,
        share=columns.share,
        is_mixed=separated.is_mixed,
        reflectance=separated.reflectance,
        reflectance_sigma=separated.reflectance_sigma,
        reradiated=separated.reradiated,
        reradiated_sigma=separated.reradiated_sigma,
        common_sigma=columns.common_sigma,
        light_sigma=columns.power_sigma / columns.power,
        drift=drift,
    )


#: Width of the bands of the light that comes back, and the longest wavelength, in nm.
BAND_NM, LAST_NM = 10.0, 780.0
#: Least number of those bands.
MIN_BANDS = 5


class LightCube(FrozenModel):
    """Images of one light.

    Attributes
    ----------
    name
        Name of the light, such as `430 nm`.
    cube
        File with the image of the sample.
    white
        File with the image of the white reference under the same light and with the same exposure;
        null: the reference is in the sample's image.
    dark
        File with the image without light; null: that of all lights.
    """

    name: Annotated[str, Field(min_length=1)]
    cube: str
    white: str | None = None
    dark: str | None = None


class CubeList(FrozenModel):
    """Hyperspectral images of a sample; files are named relative to the list's own folder.

    Attributes
    ----------
    name
        Name of the sample.
    region
        Place of the sample in its images: `[x, y, width, height]` in pixels, or all four as
        fractions of the image.
    white_region
        Place of the white reference; null: the sample's, in images of its own.
    white_reflectance
        Reflectance of the white reference: a number, or a file with its spectrum.
    dark
        File with an image without light, which is subtracted from all others; null: none.
    lights
        Images of each light, two at least.
    """

    name: Annotated[str, Field(min_length=1)]
    region: Region
    white_region: Region | None = None
    white_reflectance: Annotated[float, Field(gt=0, le=1.1)] | str
    dark: str | None = None
    lights: Annotated[tuple[LightCube, ...], Field(min_length=2)]

    @model_validator(mode="after")
    def _white_is_somewhere(self) -> Self:
        for light in self.lights:
            if light.white is None and self.white_region is None:
                raise ValueError(
                    f"expected a 'white' image of light '{light.name}', or 'white_region' in the "
                    "sample's image"
                )
        if len({light.name for light in self.lights}) < len(self.lights):
            raise ValueError("expected a name of its own for each of 'lights'")
        return self


@dataclass(frozen=True, eq=False)
class _Region:
    """Mean spectrum of a region above the dark.

    `sigma` is what scatters from wavelength to wavelength. `common` is the relative σ that all have
    in common, since texture and shading change the brightness of a pixel as a whole.
    """

    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray
    common: float

    @property
    def lit(self) -> IlluminatedSpectrum:
        return IlluminatedSpectrum(self.wavelength_nm, self.value, self.sigma)


def matrix_from_cubes(cubes: CubeList, source: Path) -> tuple[DirectColumns, str]:
    """Return the columns that hyperspectral images of a sample tell, and the sample's name.

    Parameters
    ----------
    cubes
        The images.
    source
        Path of the list, for messages and for the files that it names.

    Returns
    -------
    columns : DirectColumns
        The columns, of which `matrix` and `interpolated` make a re-radiation matrix; σ is that of
        the regions' means by the pixels' scatter, as if pixels were independent.
    name : str
        Name of the sample.

    Raises
    ------
    UsageError, DataError
        A file is missing or malformed, wavelengths of two images differ, a region is too small, or
        the white shows no light.

    Examples
    --------
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from labrig.analyse import CubeList, matrix_from_cubes
    >>> nm, rng = np.arange(400.0, 701.0, 4.0), np.random.default_rng(1)
    >>> dye = 0.1 * np.exp(-(((nm - 600) / 30) ** 2))
    >>> for peak in (450, 520):
    ...     light = np.exp(-(((nm - peak) / 10) ** 2))
    ...     pair = np.repeat([0.4 * light + dye, light], 20, axis=0)[:, None]
    ...     noise = 1e-3 * rng.standard_normal((40, 20, len(nm)))
    ...     np.savez(f"{peak}.npz", wavelength_nm=nm, values=pair + noise)
    >>> lights = [{"name": f"{peak} nm", "cube": f"{peak}.npz"} for peak in (450, 520)]
    >>> cubes = CubeList(
    ...     name="felt", region=[0, 0, 20, 20], white_region=[0, 20, 20, 20],
    ...     white_reflectance=1.0, lights=lights,
    ... )
    >>> columns, name = matrix_from_cubes(cubes, Path("felt.yaml"))
    >>> columns.input_nm.round().tolist()
    [450.0, 520.0]
    >>> columns.matrix(name).reradiated_fraction.round(1).tolist()
    [0.3, 0.3]
    """
    reflectance = _white_reflectance(cubes, source)
    whites, samples = [], []
    for light in cubes.lights:
        place = f"{source}, light '{light.name}'"
        image = _read(source, light.cube)
        white_image = image if light.white is None else _read(source, light.white)
        dark_name = light.dark or cubes.dark
        dark = None if dark_name is None else _read(source, dark_name)
        sample = _mean(image, dark, cubes.region, place)
        white = _mean(white_image, dark, cubes.white_region or cubes.region, place)
        if not np.array_equal(sample.wavelength_nm, white.wavelength_nm):
            raise DataError(
                f"{place}: expected the same wavelengths in {light.cube} and {light.white}, got "
                "others; take all images with the same settings"
            )
        samples.append(sample)
        whites.append((white, white.lit.divided_by(_on(reflectance, white.wavelength_nm, place))))
    nm = samples[0].wavelength_nm
    first_nm, last_nm = BAND_NM * np.ceil(nm[0] / BAND_NM), min(nm[-1], LAST_NM)
    output_nm = np.arange(first_nm, last_nm + 1e-6, BAND_NM)
    if len(output_nm) < MIN_BANDS:
        raise DataError(
            f"{source}: expected images of {MIN_BANDS * BAND_NM:g} nm or more below "
            f"{LAST_NM:g} nm, got {nm[0]:g} nm to {nm[-1]:g} nm"
        )
    windows = []
    for light, (_, white_light) in zip(cubes.lights, whites, strict=True):
        try:
            windows.append(light_window_nm(white_light))
        except DataError as error:
            raise DataError(f"{source}, light '{light.name}': {error}") from None
    columns = bispectral_columns(
        [light for _, light in whites],
        [sample.lit for sample in samples],
        output_nm,
        light_sigma=np.array(
            [
                np.hypot(sample.common, white.common)
                for sample, (white, _) in zip(samples, whites, strict=True)
            ]
        ),
        windows_nm=windows,
    )
    if (np.diff(columns.light_nm) < 1.0).any():
        raise DataError(f"{source}: expected lights of different wavelengths, got two of the same")
    names = [cubes.lights[place].name for place in columns.order]
    unknown = Measured(float("nan"), float("nan"))
    return direct_columns(names, columns, unknown), cubes.name


def _read(source: Path, name: str) -> HyperspectralCube:
    return read_hyperspectral_cube(source.parent / name)


def _mean(
    image: HyperspectralCube, dark: HyperspectralCube | None, region: Region, place: str
) -> _Region:
    try:
        lines, samples, _ = image.values.shape
        _, _, wide, high = region_pixels(region, samples, lines)
        if wide * high < MIN_PIXELS:
            raise DataError(
                f"expected a region of {MIN_PIXELS} pixels or more, of whose scatter σ is made; "
                f"got {wide * high}"
            )
        pixels = image.pixels(region)
    except (UsageError, DataError) as error:
        raise type(error)(f"{place}: {image.name}: {error}") from None
    variance = np.zeros_like(image.wavelength_nm)
    if dark is not None:
        if dark.values.shape != image.values.shape or not np.array_equal(
            dark.wavelength_nm, image.wavelength_nm
        ):
            raise DataError(
                f"{place}: expected a dark image like {image.name}, {dark.name} has another size "
                "or other wavelengths"
            )
        dark_pixels = dark.pixels(region)
        pixels = pixels - dark_pixels.mean(axis=0)
        variance = dark_pixels.var(axis=0, ddof=1) / len(dark_pixels)
    value = pixels.mean(axis=0)
    # Weighted by the mean itself, noise of bands without light says little about brightness.
    brightness = pixels @ value / (value @ value) if value.any() else np.ones(len(pixels))
    scatter = pixels - np.outer(brightness, value)
    noise = scatter.var(axis=0, ddof=1)
    of_noise = float(noise @ value**2 / (value @ value) ** 2) if value.any() else 0.0
    common = max(float(brightness.var(ddof=1)) - of_noise, 0.0)
    return _Region(
        image.wavelength_nm,
        value,
        np.sqrt(variance + noise / len(pixels)),
        float(np.sqrt(common / len(pixels))),
    )


def _white_reflectance(cubes: CubeList, source: Path) -> Transmittance | float:
    if isinstance(cubes.white_reflectance, float):
        return cubes.white_reflectance
    beside = source.parent / cubes.white_reflectance
    if beside.is_file():
        return read_transmittance(beside)
    return read_transmittance(resources.curve_path(cubes.white_reflectance))


def _on(reflectance: Transmittance | float, nm: FloatArray, place: str) -> FloatArray:
    if isinstance(reflectance, float):
        return np.full_like(nm, reflectance)
    value = np.interp(nm, reflectance.wavelength_nm, reflectance.value)
    if not (value > 0).all():
        raise DataError(f"{place}: expected a white that reflects at all wavelengths, got 0")
    return value
