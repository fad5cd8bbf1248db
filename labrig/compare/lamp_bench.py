"""Fluorescent samples in the rendered dark room under each lamp of a run, as its camera sees them.

The renderer's fold with the samples' re-radiation matrices gives all of their light; folded once
more without re-radiation, what is reflected. The card tells the strength of a lamp.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.acquire import read_result_rig
from labrig.bench_optics import with_shipped_camera
from labrig.compare.photographed_room import (
    DarkRoomScene,
    fractions_of,
    picture_of,
    rendered_light,
)
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.material import ReradiationMatrix
from labrig.optics import CameraResponse
from labrig.record import FrameRole, read_run
from labrig.reduce import sensor_layout
from labrig.reproduce import (
    CARD_NAME,
    Bands,
    BandsEntry,
    DarkRoomLamp,
    MaterialEntry,
    SceneFile,
    build_scene,
    camera_values,
    dark_room,
    of_matrix,
    tristimulus,
    under_lamps,
)
from labrig.results import LampPatch, PredictedUnderLamps

#: What the card shows of a lamp that is hardly seen: the tails of its spectrum, whose shape is not
#: known, as a light of the scene.
TAILS, TAILS_SPECTRUM = "tails of a spectrum", "E"
#: A white that is lit as the card is.
WHITE = "perfect white"
#: Part of the card's brightest channel from which a channel shows the card.
VISIBLE = 0.01
#: Illuminance in lux of the light by which phosphors of the scene would have been charged.
ANY_LUX = 1000.0
#: Paths of a pixel in the scene that is kept, for smooth edges.
SMOOTH = 16


@dataclass(frozen=True, eq=False)
class LitSamples:
    """Values that the camera is rendered to see under a lamp, in DN/s.

    Attributes
    ----------
    reference
        As of `RenderedLamp`.
    whole, reflected
        Light of each sample, and what of it is reflected, shape (k,).
    white
        Light of a perfect white in each sample's place; none under a lamp that shows none.
    references
        By what light of each sample is divided, shape (k,).
    strengths
        Strength of each light of the scene that belongs to the lamp, relative.
    """

    reference: str
    whole: Mapping[str, FloatArray]
    reflected: Mapping[str, FloatArray]
    white: Mapping[str, FloatArray]
    references: Mapping[str, FloatArray]
    strengths: Mapping[str, float]


class LampBench:
    """The dark room of a run under each of its lamps, folded whole and without re-radiation.

    Lights are the run's lamps and, last, that of their tails.
    """

    def __init__(
        self, folder: Path, result: PredictedUnderLamps, camera: CameraResponse, place: Path
    ) -> None:
        run = read_run(folder)
        rig = with_shipped_camera(read_result_rig(folder), run.camera_identity)
        if rig.optics.grey_card is None:
            raise UsageError(f"rig '{rig.name}': expected 'grey_card' under 'optics:', got none")
        frames = run.frames(FrameRole.DARK)
        if not frames:
            raise DataError(f"{folder}: expected dark frames, found none")
        self.result, self.camera = result, camera
        layout = sensor_layout(frames[0])
        self._picture = picture_of(layout)
        self._lights = {
            f"lamp-{number}.csv": lamp.light(name)
            for number, (name, lamp) in enumerate(result.lamps.items(), start=1)
        }
        self._spectra = dict(zip(result.lamps, self._lights, strict=True)) | {TAILS: TAILS_SPECTRUM}
        card = str(resources.curve_path(rig.optics.grey_card))
        matrices, self.left_out = _that_lose_light(result, self._file(card, {}).bands)
        self.samples = tuple(matrices)
        self._regions = {
            name: fractions_of(result.samples[name].region, layout) for name in matrices
        }
        self._materials = {
            f"material-{number}.yaml": matrix
            for number, matrix in enumerate(matrices.values(), start=1)
        }
        self._room = self._file(card, dict(zip(matrices, self._materials, strict=True)))
        one_by_one = under_lamps(
            self._room, self._spectra, [{light: 1.0} for light in self._spectra]
        )
        self.kept = DarkRoomScene(one_by_one, self._materials, self._lights)
        self.kept.write(place)
        self.whole = self._folded(one_by_one, place)
        self.reflected = self._folded(_without_reradiation(one_by_one), place)

    def patches(self, lamp: str) -> dict[str, LampPatch]:
        """Return the samples that are rendered, as they were photographed under a lamp."""
        patches = self.result.lamps[lamp].patches
        return {name: patches[name] for name in self.samples}

    def _file(self, card: str, files: Mapping[str, str]) -> SceneFile:
        """Return the dark room under one lamp, with the material files of samples."""
        patches = {
            name: (self._regions[name], MaterialEntry(file=file)) for name, file in files.items()
        }
        lamp = DarkRoomLamp(self._spectra[self.result.balance], ANY_LUX)
        return dark_room("dark-room", patches, lamp, [(0.0, 1.0)], [0.0], self._picture, card)

    def _folded(self, file: SceneFile, place: Path) -> dict[str, dict[str, FloatArray]]:
        """Return the radiance (bands,) of each sample, the card and a white, by light."""
        scene = build_scene(file, place)
        seen = rendered_light(scene, self._regions, self._picture, np.array(file.frames_s))
        (card,) = (each for each in scene.materials if each.name == CARD_NAME)
        self.edges_nm = scene.bands.edges_nm
        reflectance = card.matrix.diagonal().astype(np.float64)
        return {
            light: samples | {WHITE: samples[CARD_NAME] / reflectance}
            for light, samples in zip(self._spectra, seen.values(), strict=True)
        }

    def values(self, light: str, name: str, *, whole: bool = True) -> FloatArray:
        """Return the camera's values (k,) of a sample, the card or a white under one light."""
        folded = self.whole if whole else self.reflected
        return camera_values(folded[light][name], self.edges_nm, self.camera)

    def reradiated_luminance(self, strengths: Mapping[str, float], name: str) -> float:
        """Return the share of a sample's luminance that is re-radiated; NaN where it has none."""
        whole, reflected = (
            sum(strength * folded[light][name] for light, strength in strengths.items())
            for folded in (self.whole, self.reflected)
        )
        both = tristimulus(np.array([whole, reflected]), self.edges_nm)[:, 1]
        return float(1 - both[1] / both[0]) if both[0] > 0 else float("nan")

    def _reradiated(self, light: str, name: str) -> FloatArray:
        """Return the camera's values (k,) of what a sample re-radiates under one light."""
        return self.values(light, name) - self.values(light, name, whole=False)

    def _gains(self) -> FloatArray:
        """Return gains (k,) of the channels relative to the camera's curves, by the balanced lamp.

        A card under a narrow lamp tells how the curves err there, and not where samples re-radiate.
        """
        lamp = self.result.balance
        of_card = self.values(lamp, CARD_NAME)
        gains = np.mean([patch.card / of_card for patch in self.patches(lamp).values()], axis=0)
        return np.asarray(gains / gains.mean())

    def by_card(self, lamp: str) -> LitSamples:
        """Return the samples under a lamp whose strength the card tells, in each channel."""
        patches, camera = self.patches(lamp), self._gains()
        of_card = self.values(lamp, CARD_NAME)
        is_seen = of_card > VISIBLE * of_card.max()
        is_broad = self.result.lamps[lamp].white == "lamp"
        gains, references, whole, strengths = {}, {}, {}, []
        for name, patch in patches.items():
            strength = patch.card[is_seen].sum() / (camera * of_card)[is_seen].sum()
            by_channel = patch.card / np.where(is_seen, of_card, 1.0)
            gains[name] = np.where(is_seen, by_channel, strength * camera)
            references[name] = np.where(is_seen, patch.card, patch.card.max())
            seen_by = gains[name] if is_broad else strength * camera
            whole[name] = seen_by * self._reradiated(lamp, name)
            whole[name] += gains[name] * self.values(lamp, name, whole=False)
            strengths.append(strength)
        return LitSamples(
            reference="card",
            whole=whole,
            reflected={
                name: gains[name] * self.values(lamp, name, whole=False) for name in patches
            },
            white={name: gains[name] * self.values(lamp, WHITE) for name in patches},
            references=references,
            strengths={lamp: float(np.mean(strengths))},
        )

    def by_samples(self, lamp: str, evenness: Mapping[str, float]) -> LitSamples:
        """Return the samples under a lamp of which the card shows the tails of its spectrum only.

        One strength for all is the most likely one.
        """
        patches, camera = self.patches(lamp), self._gains()
        of_card = self.values(TAILS, CARD_NAME)
        tails = {
            name: self.values(TAILS, name, whole=False) / of_card * patch.card
            for name, patch in patches.items()
        }
        unit = {name: evenness[name] * camera * self.values(lamp, name) for name in patches}
        numerator = denominator = 0.0
        for name, patch in patches.items():
            weight = 1 / (patch.sigma**2 + patch.predicted_sigma**2)
            numerator += float((weight * unit[name]) @ (patch.value - tails[name]))
            denominator += float((weight * unit[name]) @ unit[name])
        if not numerator > 0:
            raise DataError(
                f"{lamp}: no sample shines under this lamp, of which the camera sees next to "
                "nothing; leave it out of 'lamps:' in the run's protocol.yaml, and process it "
                "again with --edited"
            )
        strength = numerator / denominator
        own = {name: strength * evenness[name] * camera for name in patches}
        whole = {name: strength * unit[name] + tails[name] for name in patches}
        brightest = np.full(len(of_card), max(float(values.max()) for values in whole.values()))
        of_tails = float(
            np.mean([(patch.card / (camera * of_card)).mean() for patch in patches.values()])
        )
        return LitSamples(
            reference="brightest",
            whole=whole,
            reflected={
                name: own[name] * self.values(lamp, name, whole=False) + tails[name]
                for name in patches
            },
            white={},
            references=dict.fromkeys(patches, brightest),
            strengths={lamp: strength, TAILS: max(of_tails, 0.0)},
        )

    def scene(self, strengths: Mapping[str, Mapping[str, float]]) -> DarkRoomScene:
        """Return the room with a picture under each lamp, which has the strength photographed.

        The light of the lamp by which colours are balanced is 1 W m⁻².
        """
        unit = strengths[self.result.balance][self.result.balance]
        pictures = [
            {light: strength / unit for light, strength in each.items()}
            for each in strengths.values()
        ]
        used = {light for each in strengths.values() for light in each}
        spectra = {light: file for light, file in self._spectra.items() if light in used}
        file = under_lamps(self._room, spectra, pictures)
        paths = file.paths.model_copy(update={"per_pixel": SMOOTH})
        return replace(self.kept, file=file.model_copy(update={"paths": paths}))


def _that_lose_light(
    result: PredictedUnderLamps, entry: BandsEntry
) -> tuple[dict[str, ReradiationMatrix], tuple[ResultWarning, ...]]:
    """Return the matrices that a renderer takes, and a warning about each of the others.

    A radiance factor, which a bench measures for one direction, may be above 1; a scene's albedo
    may not.
    """
    bands = Bands.even(**entry.model_dump())
    matrices = {}
    left_out: list[ResultWarning] = []
    for name, sample in result.samples.items():
        matrix = sample.matrix.named(name)
        try:
            of_matrix(matrix, bands)
        except (UsageError, DataError) as error:
            left_out.append(Unmeasured("patch-failed", "left out: {reason}", reason=str(error)))
        else:
            matrices[name] = matrix
    if not matrices:
        raise UsageError(f"no sample can be rendered; {left_out[0]}")
    return matrices, tuple(left_out)


def lit_by_all(bench: LampBench) -> dict[str, LitSamples]:
    """Return the samples under each lamp, in the order of the lamps."""
    lamps = bench.result.lamps
    of_card = {name: bench.by_card(name) for name, lamp in lamps.items() if lamp.scale == "card"}
    evenness = _evenness([bench.patches(name) for name in of_card], bench.samples)
    return {
        name: of_card[name] if name in of_card else bench.by_samples(name, evenness)
        for name in lamps
    }


def _evenness(lit: Sequence[Mapping[str, LampPatch]], names: Sequence[str]) -> dict[str, float]:
    """Return the light at each sample over that at all of them, by the card under some lamps."""
    if not lit:
        return dict.fromkeys(names, 1.0)
    light = np.array([[patches[name].card.sum() for name in names] for patches in lit])
    return dict(zip(names, np.median(light.T / light.mean(axis=1), axis=1).tolist(), strict=True))


def _without_reradiation(file: SceneFile) -> SceneFile:
    """Return a scene whose materials reflect only."""
    materials = {
        name: entry if entry.file is None else entry.model_copy(update={"is_fluorescent": False})
        for name, entry in file.materials.items()
    }
    return file.model_copy(update={"materials": materials})
