"""Frames of a lit strip, made for tests pixel by pixel."""

from dataclasses import dataclass, replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    Lvf,
    Spectrum,
    WavelengthMap,
    nominal_lvf,
    read_camera,
    signal_through,
)
from labrig.reduce import RawFrame
from labrig.reduce.hdr import HdrFrame, hdr_frame

BLACK, WHITE = 1024, 15600
#: True wavelengths from the blue end (0) to the red end (1) of the lit part.
TRUE_MAP = WavelengthMap(np.array([550.0, 155.0, 5.0]), (0.0, 1.0))


@dataclass(frozen=True)
class Scene:
    """A strip `length` × `height` (fractions of the frame) in its middle."""

    width: int = 480
    height: int = 320
    length: float = 0.8
    thickness: float = 0.3
    tilt_degrees: float = 0.0
    rising: bool = True
    electrons: float = 12_000.0
    read_noise_dn: float = 5.0
    seed: int = 1

    def along(self) -> tuple[FloatArray, FloatArray]:
        """Position of every pixel from the left end to the right, and its share of the height."""
        x = np.arange(self.width) + 0.5 - self.width / 2
        y = (np.arange(self.height) + 0.5 - self.height / 2)[:, np.newaxis]
        angle = np.radians(self.tilt_degrees)
        along = (x * np.cos(angle) + y * np.sin(angle)) / (self.length * self.width) + 0.5
        aside = (y * np.cos(angle) - x * np.sin(angle)) / (self.thickness * self.height)
        return along, aside

    def frame(self, light: Spectrum, exposure: float = 1.0) -> tuple[RawFrame, float]:
        """The strip under a light whose brightest colour fills the range at `exposure` 1."""
        seen = signal_through(self.lvf(), read_camera("canon_eos_5d_mark_ii"), light)
        along, aside = self.along()
        inside = (along >= 0) & (along <= 1) & (np.abs(aside) <= 0.5)
        position = along if self.rising else 1 - along
        colours = np.stack(
            [np.interp(position, self.lvf().position, column) for column in seen.T], axis=-1
        )
        colours *= inside[..., np.newaxis] * exposure * (WHITE - BLACK) / seen.max()
        cfa = np.array([[0, 1], [1, 2]])
        channel = np.tile(cfa, (self.height // 2, self.width // 2))
        clean = np.take_along_axis(colours, channel[..., np.newaxis], axis=-1)[..., 0]
        rng = np.random.default_rng(self.seed)
        per_dn = self.electrons / (WHITE - BLACK)
        noisy = rng.poisson(clean * per_dn) / per_dn
        noisy = noisy + rng.normal(BLACK, self.read_noise_dn, clean.shape)
        mosaic = np.clip(np.round(noisy), 0, WHITE).astype(np.uint16)
        return RawFrame(mosaic, "RGGB", (BLACK,) * 4, WHITE), exposure

    def lvf(self) -> Lvf:
        """Bands of 25 nm."""
        return nominal_lvf(TRUE_MAP, np.linspace(400.5, 709.5, 400), leakage=0.001)


def halogen() -> Spectrum:
    """A filament of 3000 K by Planck's law, relative."""
    nm = np.arange(360.0, 801.0, 5.0)
    return Spectrum("halogen", nm, (nm / 560) ** -5 / np.expm1(1.4388e7 / nm / 3000) * 5000)


def mercury() -> Spectrum:
    """Lines half a nanometre wide over a faint continuum."""
    lines = {404.6565: 0.5, 435.8335: 1.0, 546.0750: 0.9, 576.9610: 0.24, 579.0670: 0.25}
    feet = [[nm - 0.5, nm, nm + 0.5] for nm in lines]
    nm = np.unique(np.concatenate([[300.0, 900.0], *feet]))
    value = np.full(len(nm), 1e-4)
    for line, height in lines.items():
        value[nm == line] += height
    return Spectrum("mercury", nm, value)


def bracket(scene: Scene, light: Spectrum, exposures: tuple[float, ...] = (0.4, 4.0)) -> HdrFrame:
    """Several exposures of a scene as one frame."""
    return hdr_frame(
        replace(scene, seed=scene.seed + k).frame(light, e) for k, e in enumerate(exposures)
    )
