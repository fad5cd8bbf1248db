"""The bank of broadband lamps, under which samples are seen as in daily life, one at a time."""

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Protocol, runtime_checkable

from pydantic import Field

from labrig.acquire.roles.leds import LedLight
from labrig.acquire.roles.light_bank import BankSwitch, LightBank, PlannedLightBank, exercise
from labrig.acquire.roles.role import Role
from labrig.foundation import resources
from labrig.foundation.named_files import ShippedOrFile
from labrig.foundation.quantity import DurationS
from labrig.optics import Spectrum, read_light


class Illuminant(LedLight):
    """The light of a lamp as far as it is known: keys of each lamp of a bank.

    Attributes
    ----------
    spectrum
        Spectrum of the lamp in relative units per nm: a CIE illuminant such as `D65`, the name of a
        shipped file such as `halogen_3000k`, or the path of a file; given instead of `centre` and
        `fwhm`.
    settling
        Time from switching on until the lamp is warm and its light steady, for example `10 min`;
        protocols wait for it.
    filter
        Colour filter that is fixed before the lamp, by its name in the rig's folder of filters.
        Default: none.

    Examples
    --------
    >>> from labrig.acquire import Illuminant
    >>> lamp = Illuminant.model_validate({"spectrum": "halogen_3000k", "settling": "10 min"})
    >>> lamp.settling, lamp.relative_spectrum().at([450.0, 650.0]).round(2).tolist()
    (600.0, [0.39, 1.49])
    """

    spectrum: ShippedOrFile | None = None
    settling: Annotated[DurationS, Field(ge=0, le=7200)] = 0.0
    filter: Annotated[str, Field(min_length=1)] | None = None

    def relative_spectrum(self) -> Spectrum | None:
        """Return the spectrum per nm without the filter, None if the rig file says nothing of it.

        Raises
        ------
        UsageError
            There is no such illuminant and no such file, or the file is malformed.
        """
        if self.spectrum is None:
            return super().relative_spectrum()
        shipped = resources.curve_path(self.spectrum)
        return read_light(shipped if shipped.exists() else self.spectrum)


@runtime_checkable
class LampBank(LightBank, Protocol):
    """Broadband lamps of which at most one is on. Safe state: all off."""

    @classmethod
    def declared_lamps(cls, settings: Any, /) -> Mapping[str, Illuminant]:
        """Return what the rig file says of the lamps' light by their names, for plans."""


class IlluminantSwitch(BankSwitch):
    """The action that switches one lamp of the bank on and all others off, or all off for None."""

    device = "illuminants"
    noun = "a lamp"


ILLUMINANTS_OFF = IlluminantSwitch(None)

ILLUMINANTS: Role[LightBank] = Role(
    key="illuminants",
    protocol_class=LampBank,
    name="bank of lamps",
    planned=lambda driver, settings, clock: PlannedLightBank(driver.declared_lamps(settings)),
    exercise=partial(exercise, nouns="lamps"),
    state=lambda bank: str(IlluminantSwitch(bank.channel_on())),
    safe_first=True,
)
