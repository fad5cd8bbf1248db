"""Fluorescent samples under lamps, rendered through the measured camera, beside their photographs.

What is compared is light of the sample over light of the grey card in its place under the same
lamp, in each channel: no exposure, no strength of a lamp and no gain of a channel is in it. Of a
lamp that the camera hardly sees, one strength for all samples is fitted.
"""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.compare.glow import RGB
from labrig.compare.lamp_bench import LampBench, LitSamples, lit_by_all
from labrig.compare.photographed_room import DarkRoomScene
from labrig.compare.run import measured_camera
from labrig.compare.viewing import DEFAULT_WHITE, Viewing, viewing
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.plugins import measurement
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.optics import CIE_1931, delta_e, lab, observer, white_xyz
from labrig.record import plan_content
from labrig.results import LampPatch, PredictedUnderLamps, read_result

#: Light of a sample that is shown: as photographed, all that is rendered, and its two parts.
LOOKS = PHOTOGRAPH, RENDERED, REFLECTED, RERADIATED = (
    "photograph", "rendered", "reflected", "re-radiated"
)  # fmt: skip
#: White of a screen.
SCREEN = "D65"


@dataclass(frozen=True, eq=False)
class RenderedSample:
    """A sample under a lamp, photographed and rendered.

    Attributes
    ----------
    photographed, photographed_sigma
        Light of the sample over that of the reference, and σ by noise and flicker, shape (k,).
    rendered, rendered_sigma
        The same of the rendering; σ is that of the lamp's spectrum, the camera's curves, the card
        and the matrix, shape (k,).
    reradiated
        Share of the rendered light that is re-radiated; NaN where there is none, shape (k,).
    reradiated_luminance
        The same of the luminance.
    delta_e, delta_e_reflected
        ΔE2000 of photograph and rendering, and of photograph and what is reflected.
    delta_e_by_errors
        Root mean square of the ΔE2000 that the errors of both alone would make.
    xyz
        X, Y, Z of each of `LOOKS` for a picture.
    """

    photographed: FloatArray
    photographed_sigma: FloatArray
    rendered: FloatArray
    rendered_sigma: FloatArray
    reradiated: FloatArray
    reradiated_luminance: float
    delta_e: float
    delta_e_reflected: float
    delta_e_by_errors: float
    xyz: Mapping[str, FloatArray]

    @property
    def excess(self) -> FloatArray:
        """Return rendered over photographed light − 1; NaN where there is none, shape (k,)."""
        return _over(self.rendered - self.photographed, self.photographed)

    @property
    def in_sigma(self) -> FloatArray:
        """Return the difference of rendered and photographed light in σ, shape (k,)."""
        sigma = np.hypot(self.photographed_sigma, self.rendered_sigma)
        return np.asarray((self.rendered - self.photographed) / sigma)


@dataclass(frozen=True, eq=False)
class RenderedLamp:
    """All samples under a lamp.

    Attributes
    ----------
    name
        Name of the lamp.
    reference
        What light is divided by: the grey `card` in the sample's place, or the `brightest` value
        that is rendered, where the camera hardly sees the lamp and one strength for all samples is
        fitted.
    samples
        The samples by name.
    """

    name: str
    reference: str
    samples: Mapping[str, RenderedSample]


@dataclass(frozen=True, eq=False)
class LampsComparison:
    """Fluorescent samples under lamps, rendered beside their photographs.

    Attributes
    ----------
    channels
        Names of the k channels.
    lamps
        The lamps.
    description
        How it was compared, in paragraphs for people.
    notes
        Warnings about values that are assumed or missing.
    scene
        The dark room with a picture under each lamp.
    """

    channels: tuple[str, ...]
    lamps: tuple[RenderedLamp, ...]
    description: tuple[str, ...]
    notes: tuple[ResultWarning, ...]
    scene: DarkRoomScene


def is_of_fluorescence(folder: Path) -> bool:
    """Return whether a run photographed fluorescent samples under lamps.

    Parameters
    ----------
    folder
        Run folder.

    Returns
    -------
    bool
        Whether `compare_lamps` compares it; False of runs with a decay, and where there is no run.

    Raises
    ------
    UsageError
        The run measured fluorescence, but has no photographs under lamps.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.compare import is_of_fluorescence
    >>> is_of_fluorescence(Path("runs/decay"))
    False
    """
    path = folder / "protocol.yaml"
    protocol = plan_content(folder, path.name).get("protocol") if path.is_file() else None
    if not isinstance(protocol, str):
        return False
    registered = measurement(protocol, str(path))
    is_under_lamps = issubclass(registered.load("result"), PredictedUnderLamps)
    if registered.is_of_fluorescence and not is_under_lamps:
        raise UsageError(
            f"{folder}: expected photographs under lamps, got a run of {protocol}; take them with "
            "labrig run validate_illuminants, whose 'fluorescence:' names this run or its "
            "materials, then compare that run"
        )
    return is_under_lamps


def compare_lamps(
    folder: Path, white: str = DEFAULT_WHITE, camera: str | None = None
) -> LampsComparison:
    """Render fluorescent samples under the lamps of a run, and compare them with its photographs.

    Parameters
    ----------
    folder
        Folder of a run of `validate_illuminants` with a result.
    white
        CIE illuminant that is the white of CIELAB under lamps that show no white, such as `D65`.
    camera
        Camera curves that replace those with which the run was processed, by shipped name or path.

    Returns
    -------
    LampsComparison
        Light and colours of all samples under all lamps.

    Raises
    ------
    UsageError
        There is no result, the rig file names no grey card or no camera curves, or a matrix
        returns more light than it gets.
    DataError
        The result is damaged, or the frames are missing.

    References
    ----------
    Hua, Tázlár, Fichet, Wilkie, "A compact representation for fluorescent spectral data" (EGSR
    2021), and the thesis whose figure 5.3 has photographs and predictions side by side.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.compare import compare_lamps
    >>> compared = compare_lamps(Path("runs/validation"))  # doctest: +SKIP
    >>> compared.lamps[0].samples["yellow"].delta_e < 3  # doctest: +SKIP
    True
    """
    result = read_result(folder)
    if not isinstance(result, PredictedUnderLamps):
        raise UsageError(f"{folder}: expected a run of validate_illuminants, got {result.kind}")
    curves, reasons = measured_camera(folder, camera)
    if curves is None:
        raise UsageError(f"the dark room cannot be rendered: {reasons[0]}")
    if result.channels != RGB:
        raise UsageError(
            f"{folder}: expected a camera with R, G, B, got {', '.join(result.channels)}; there is "
            "no colour to compare"
        )
    conversion = viewing(curves, white)
    with tempfile.TemporaryDirectory() as place:
        bench = LampBench(folder, result, curves, Path(place))
    lit = lit_by_all(bench)
    look = _Look.of(conversion, lit[result.balance])
    return LampsComparison(
        result.channels,
        tuple(_compared(name, bench, each, look) for name, each in lit.items()),
        _description(result, conversion),
        (*bench.left_out, *_notes(result, is_same_camera=camera is None)),
        bench.scene({name: each.strengths for name, each in lit.items()}),
    )


@dataclass(frozen=True, eq=False)
class _Look:
    """Conversion of values of the camera to colours and pictures.

    Attributes
    ----------
    conversion
        Matrix to X, Y, Z, and the white under lamps that show none.
    to_picture
        Factors of X, Y, Z that make the white under the balanced lamp a screen's, (3,).
    """

    conversion: Viewing
    to_picture: FloatArray

    @classmethod
    def of(cls, conversion: Viewing, balanced: LitSamples) -> "_Look":
        """Return the look in which white is white under a lamp."""
        screen = white_xyz(SCREEN, observer(CIE_1931))
        white = conversion.to_xyz @ np.mean(list(balanced.white.values()), axis=0)
        return cls(conversion, screen * white[1] / white)

    def exposed(self, values: Iterator[FloatArray]) -> "_Scale":
        """Return the scale on which the brightest of some photographs just reaches the white."""
        white = self.conversion.white
        reach = max(float((self.conversion.to_xyz @ each / white).max()) for each in values)
        return _Scale(self.conversion.to_xyz / max(reach, 1e-300), white)

    def under(self, white: FloatArray) -> "_Scale":
        """Return the scale on which a white with these values (k,) has Y = 1 and no colour."""
        xyz = self.conversion.to_xyz @ white
        return _Scale(self.conversion.to_xyz / xyz[1], xyz / xyz[1])


@dataclass(frozen=True, eq=False)
class _Scale:
    """Matrix from values to X, Y, Z (3, k), and the white of CIELAB (3,)."""

    matrix: FloatArray
    white: FloatArray

    def xyz(self, values: FloatArray) -> FloatArray:
        return np.maximum(self.matrix @ values, 0.0)

    def difference(self, one: FloatArray, other: FloatArray) -> float:
        """Return ΔE2000 of two values."""
        return float(delta_e(*(lab(self.xyz(each), self.white) for each in (one, other))))


def _compared(name: str, bench: LampBench, lit: LitSamples, look: _Look) -> RenderedLamp:
    """Compare photographs and renderings under a lamp."""
    patches, is_white = bench.patches(name), bench.result.lamps[name].white == "lamp"
    exposed = look.exposed(patch.value for patch in patches.values())
    samples = {}
    for sample, patch in patches.items():
        scale = look.under(lit.white[sample]) if is_white else exposed
        share = bench.reradiated_luminance(lit.strengths, sample)
        samples[sample] = _sample(patch, sample, lit, scale, look.to_picture, share)
    return RenderedLamp(name, lit.reference, samples)


def _sample(
    patch: LampPatch,
    name: str,
    lit: LitSamples,
    scale: _Scale,
    to_picture: FloatArray,
    reradiated_luminance: float,
) -> RenderedSample:
    whole, reflected, reference = lit.whole[name], lit.reflected[name], lit.references[name]
    light = {
        PHOTOGRAPH: patch.value,
        RENDERED: whole,
        REFLECTED: reflected,
        RERADIATED: whole - reflected,
    }
    return RenderedSample(
        photographed=patch.value / reference,
        photographed_sigma=patch.sigma / reference,
        rendered=whole / reference,
        rendered_sigma=patch.predicted_sigma / reference,
        reradiated=_over(whole - reflected, whole),
        reradiated_luminance=reradiated_luminance,
        delta_e=scale.difference(patch.value, whole),
        delta_e_reflected=scale.difference(patch.value, reflected),
        delta_e_by_errors=patch.delta_e_by_errors,
        xyz={what: to_picture * scale.xyz(values) for what, values in light.items()},
    )


def _over(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return a part over its whole, NaN where that is not above 0."""
    return np.asarray(np.divide(part, whole, out=np.full(len(whole), np.nan), where=whole > 0))


def _description(result: PredictedUnderLamps, conversion: Viewing) -> tuple[str, ...]:
    return (
        f"The dark room is rendered under each lamp with the matrices of {result.fluorescence}, in "
        "bands of 10 nm. Light of a sample is divided by that of the grey card in its place, which "
        "measures the brightness of the lamp in each channel; under a narrow lamp the gains of the "
        f"channels are those under {result.balance}. Under a lamp that the camera hardly sees, it "
        "is divided by the brightest rendered light, and one strength for all samples is fitted.",
        "σ of a rendering is that of the prediction in the run's result: lamps' spectra, camera's "
        "curves, card, and matrices.",
        f"CIELAB: {conversion.source}. Its white is a perfect one under the lamp; where the lamp "
        "shows none, the one named, which the brightest photograph just reaches.",
    )


def _notes(result: PredictedUnderLamps, *, is_same_camera: bool) -> Iterator[ResultWarning]:
    if result.without_matrix_sigma:
        yield Unmeasured(
            "matrix-without-sigma",
            "the matrices of {samples} have no σ, which is missing in that of the renderings",
            samples=result.without_matrix_sigma,
        )
    if not is_same_camera:
        yield Unmeasured(
            "sigma-of-other-curves",
            "σ is that of the camera's curves with which the run was processed",
        )
