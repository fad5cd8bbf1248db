"""The spectrometer: how the light is distributed over wavelengths."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, Role


@runtime_checkable
class Spectrometer(Device, Protocol):
    """Measures relative spectral irradiance. Safe: idle."""

    def wavelengths_nm(self) -> tuple[float, ...]:
        """Wavelength of each pixel, ascending."""

    def counts(self, integration_s: float) -> tuple[float, ...]:
        """One reading, dark not subtracted, one value per wavelength."""


SPECTROMETER: Role[Spectrometer] = Role(key="spectrometer", does=Spectrometer, name="spectrometer")
