"""The part that measures irradiance: its file, its figure, what it says."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from labrig.analyse.irradiance.figures import irradiance_figure, scale_figure
from labrig.analyse.irradiance.scales import FloatArray, Ratio, Scales, in_bands, scales

from labrig.analyse.bench_curves import camera_curves, card_reflectance, lamp_spectrum
from labrig.analyse.part import Part, StageResult
from labrig.analyse.strip_frames import StripFrames
from labrig.calibration import IrradianceFile, LvfFile, write_irradiance_file
from labrig.errors import UsageError
from labrig.optics import Lvf, Spectrum
from labrig.optics.piecewise import band_integrals
from labrig.reduce.strip import FLICKER, slice_values
from labrig.report import Picture, Section, Table
from labrig.results.strip import SliceValues
from labrig.written_numbers import plus_minus, rounded

#: Change of the lamp between rounds that is worth a warning.
DRIFT = 0.03


@dataclass(frozen=True, eq=False)
class Lit:
    """What the pictures of all rounds say.

    Attributes
    ----------
    ratio
        Mean over the rounds.
    drift
        Scatter of the rounds about it, all places and colours together; relative.
    rounds
        How many.
    """

    ratio: Ratio
    drift: float
    rounds: int

    @property
    def sigma(self) -> float:
        """Standard uncertainty common to all ratios, relative."""
        return float(np.hypot(FLICKER * np.sqrt(2), self.drift) / np.sqrt(self.rounds))


def process(part: Part) -> StageResult:
    """Write irradiance.yaml.

    Raises
    ------
    UsageError
        No calibrated LVF is known, or curves are missing in the rig file.
    DataError
        Frames are missing or damaged, or some position was not lit.
    """
    known = part.inputs.lvf
    if known is None or known.on_sample is None:
        raise UsageError(
            f"{part.run.folder}: no LVF is known that lies on the sample; run lvf_calibration, "
            "and name its run in the rig file (optics: {lvf: …}) or to labrig process --optics"
        )
    frames, lamp = StripFrames(part), lamp_spectrum(part.rig)
    lit = _lit(part, frames, known)
    position = np.array(known.on_sample.positions(*frames.size))
    places = np.clip(position, known.position[0], known.position[-1])
    lvf = known.lvf.at(places)
    camera = camera_curves(part.rig, part.choices, known)
    found = scales(lit.ratio, lvf, lamp, card_reflectance(part.rig), camera)
    file = _file(part, known, (lvf, lamp), found, lit)
    write_irradiance_file(part.folder / "irradiance.yaml", file)
    return StageResult(
        known=replace(part.inputs, irradiance=file),
        sections=(_section(file, found, lvf),),
        lines=tuple(_lines(file)),
        warnings=tuple(_warnings(lit)),
    )


def _lit(part: Part, frames: StripFrames, known: LvfFile) -> Lit:
    assert known.on_sample is not None, "asked before"
    lit = [*frames.of("irradiance-direct"), *frames.of("irradiance-through")]
    values = slice_values(lit, known.on_sample, frames.dark, part.inputs.camera)
    pairs = [
        (values[f"direct-{number}"], values[f"through-{number}"])
        for number in range(1, part.protocol.rounds + 1)
        if f"direct-{number}" in values and f"through-{number}" in values
    ]
    return mean_ratio(pairs)


def mean_ratio(pairs: list[tuple[SliceValues, SliceValues]]) -> Lit:
    """Of the rounds, each a picture of the card by itself and one through the LVF."""
    ratios = np.stack([through.value / direct.value for direct, through in pairs])
    relative = [
        np.hypot(through.sigma / direct.value, ratio * direct.sigma / direct.value)
        for (direct, through), ratio in zip(pairs, ratios, strict=True)
    ]
    weight = 1 / np.stack(relative) ** 2
    total = weight.sum(axis=0)
    mean = (weight * ratios).sum(axis=0) / total
    clear = mean > 30 / np.sqrt(total)
    each = [float(np.median((ratio / mean)[clear])) for ratio in ratios]
    drift = float(np.std(each, ddof=1)) if len(each) > 1 else 0.0
    return Lit(Ratio(mean, 1 / np.sqrt(total)), drift, len(pairs))


def _file(
    part: Part, known: LvfFile, light: tuple[Lvf, Spectrum], found: Scales, lit: Lit
) -> IrradianceFile:
    assert known.on_sample is not None, "asked before"
    lvf, lamp = light
    edges = np.array(part.protocol.bands_nm)
    direct = band_integrals(lamp.wavelength_nm, lamp.value, edges)
    norm = part.protocol.vector_length / float(np.linalg.norm(direct))
    shape, shape_sigma = in_bands(lvf, lamp, edges)
    factor = found.value[:, np.newaxis] * norm
    relative = np.sqrt(np.diag(found.covariance))
    through = shape * factor
    sigma = np.hypot(through * relative[:, np.newaxis], shape_sigma * factor)
    ratio = norm * direct.sum() / through.sum(axis=1)
    return IrradianceFile(
        lamp=lamp.name,
        bands_nm=part.protocol.bands_nm,
        vector_length=part.protocol.vector_length,
        direct=tuple((norm * direct).tolist()),
        direct_sigma=tuple(_direct_sigma(lamp, edges, norm).tolist()),
        position=tuple(lvf.position.tolist()),
        through=tuple(tuple(row) for row in through.tolist()),
        through_sigma=tuple(tuple(row) for row in sigma.tolist()),
        scale_sigma=lit.sigma,
        ratio=tuple(ratio.tolist()),
        ratio_sigma=tuple((ratio * np.hypot(relative, lit.sigma)).tolist()),
        strip=known.on_sample,
        source=f"grey card by itself and through the LVF in {lit.rounds} rounds, with labrig",
        run=part.run.folder.resolve().name,
    )


def _direct_sigma(lamp: Spectrum, edges: FloatArray, norm: float) -> FloatArray:
    """By what the lamp's file says; errors of neighbouring wavelengths taken to go together."""
    if lamp.sigma is None:
        return np.zeros(len(edges) - 1)
    return norm * band_integrals(lamp.wavelength_nm, lamp.sigma, edges)


def _lines(file: IrradianceFile) -> Iterator[str]:
    direct = ", ".join(rounded(value, 3) for value in file.direct)
    yield f"the lamp by itself, E per band: {direct} (length {rounded(file.vector_length)})"
    for k in (0, len(file.position) // 2, len(file.position) - 1):
        band = int(np.argmax(file.through[k]))
        low, high = file.bands_nm[band : band + 2]
        peak = plus_minus(file.through[k][band], file.through_sigma[k][band])
        yield (
            f"p{k:02d}: E {peak} in {low:g}-{high:g} nm; direct : through "
            f"{plus_minus(file.ratio[k], file.ratio_sigma[k])}"
        )


def _warnings(lit: Lit) -> Iterator[str]:
    if lit.drift > DRIFT:
        yield (
            f"the lamp changed by {lit.drift:.1%} from round to round; let it warm up for longer, "
            "or look for something that was moved"
        )


def _section(file: IrradianceFile, found: Scales, lvf: Lvf) -> Section:
    head = ("Band / nm", *(f"{low:g}" for low in file.bands_nm[:-1]))
    rows = (
        ("direct", *(rounded(value, 3) for value in file.direct)),
        *(
            (f"p{k:02d}", *(rounded(value, 2) for value in file.through[k]))
            for k in range(0, len(file.position), 5)
        ),
    )
    return Section(
        "Irradiance on the sample",
        (
            "E of every band is ∫ E dλ over it, scaled so that the lamp by itself has the length "
            f"{rounded(file.vector_length)}: excitation rates belong to that. Through the LVF, its "
            "calibration gives the shape and the grey card the scale at every position, both with "
            f"their σ; common to all positions are {100 * file.scale_sigma:.1f} % more.",
        ),
        (
            Picture(
                "irradiance",
                irradiance_figure(file),
                "Irradiance of every band along the strip behind the LVF, with 1 σ; where it is "
                "less than 2 % of its highest, it is not drawn.",
            ),
            Picture(
                "scale",
                scale_figure(file, found, lvf.bands.centre_nm),
                "What the card shows over what the calibration of the LVF lets expect: each "
                "position by itself (points, 1 σ with the camera's curves), and with its "
                "neighbours (line and band).",
            ),
        ),
        (Table(head, rows, "Columns begin at the wavelength in their head."),),
    )
