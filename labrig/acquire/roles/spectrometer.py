"""The spectrometer, which measures the spectral distribution of light."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, Role


@runtime_checkable
class Spectrometer(Device, Protocol):
    """An instrument that measures relative spectral irradiance. Safe state: idle."""

    def wavelengths_nm(self) -> tuple[float, ...]:
        """Return the wavelength of each pixel in nm, ascending."""

    def counts(self, integration_s: float) -> tuple[float, ...]:
        """Return one reading in counts per pixel, without dark subtraction."""


SPECTROMETER: Role[Spectrometer] = Role(
    key="spectrometer", protocol_class=Spectrometer, name="spectrometer"
)
