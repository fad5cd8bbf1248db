"""What the simulated room knows and labrig must find out: for tests, never for a fit."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class TrueState(_Part):
    """One state of a patch.

    Attributes
    ----------
    concentration
        r at the moment of the last lamp-off; null if the lamp was never switched off.
    amplitude_dn_per_s
        R, G, B: what the state adds to the signal per second of exposure, extrapolated from the
        dark back to lamp-off (the fade charges a little more), in the middle of the lens.
    """

    k_r_per_s: float
    concentration: float | None
    amplitude_dn_per_s: tuple[float, float, float] | None


class TruePatch(_Part):
    """One sample and its states by falling rate."""

    material: str
    region: tuple[float, float, float, float]
    states: tuple[TrueState, ...]


class Truth(_Part):
    """The room's parameters.

    Attributes
    ----------
    lamp_off_s
        Time of the last lamp-off on the room's clock.
    iso, f_number
        To which the amplitudes belong.
    sensitivity
        Rows R, G, B of the camera's own curves on `wavelength_nm`.
    lamp_irradiance
        Relative spectral irradiance of the warm, new lamp on `wavelength_nm`.
    """

    lamp_off_s: float | None
    iso: int
    f_number: float
    patches: tuple[TruePatch, ...]
    wavelength_nm: tuple[float, ...]
    sensitivity: tuple[tuple[float, ...], ...]
    lamp_irradiance: tuple[float, ...]

    def write(self, path: Path) -> None:
        """As JSON."""
        path.write_text(self.model_dump_json(indent=1) + "\n", encoding="utf-8")
