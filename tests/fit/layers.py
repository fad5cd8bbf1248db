"""Layers that light is absorbed in."""

from labrig.foundation.arrays import FloatArray
from labrig.sim.kinetics import KineticsSettings, layers_of
from labrig.sim.lamp import Lamp
from labrig.sim.phosphor import phosphor
from tests.fit.charged_samples import Bench


class Layer(Bench):
    """A layer of an optical density, where light of each band is absorbed as much as it excites."""

    optical_density = 1.0

    def _glow(self, windows: FloatArray, lamp: Lamp, charges: object) -> FloatArray:
        bare = phosphor([self.material], [None], self.irradiance)
        settings = KineticsSettings(optical_density=self.optical_density)
        passed, share = layers_of(settings, bare.excitation)
        each = (windows[:, None, :] * passed).reshape(-1, windows.shape[1])
        glow = super()._glow(each, lamp, charges)  # type: ignore[arg-type]
        mean: FloatArray = glow.reshape(len(glow), len(windows), -1) @ share
        return mean
