"""The blank file: signal of a decay's frames without a glowing sample."""

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.errors import DataError
from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive
from labrig.foundation.result_warning import Disturbance, ResultWarning

Row = tuple[Finite, ...]

#: Number of σ from which a constant level is reported.
SIGNIFICANT = 4.0
#: Scatter of the begins of frames in s, by jitter of relays and shutters.
SAME_TIME_S = 0.02


class BlankFile(FrozenModel):
    """Light after lamp off without a sample, in DN/s above dark frames taken as those of the decay.

    Attributes
    ----------
    iso, f_number
        Settings to which the numbers belong.
    channels
        Names of the channels.
    t_s
        Rising middles of the exposures in seconds after lamp off.
    rate_dn_per_s, sigma_dn_per_s
        Signal without the constant level and its σ in DN/s, a row for each of `t_s`, a number for
        each channel.
    constant_dn_per_s, constant_dn_per_s_sigma
        Constant level after lamp off that the dark frames lack, in DN/s, and its σ.
    ambient_dn_per_s, ambient_dn_per_s_sigma
        Stray light in frames and dark frames alike, beyond dark current, in DN/s, and its σ. It is
        a lower bound: the channel with the least signal is taken for dark.
    first_clean_s
        Time after lamp off in seconds from which only the constant level remains; null if never.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import BLANK_KIND
    >>> blank = BLANK_KIND.read(Path("blank.yaml"))
    >>> blank.channels, blank.is_clean(2.0)
    (('R', 'G', 'B'), True)
    """

    kind: Literal["blank"] = "blank"
    iso: Positive
    f_number: Positive | None
    channels: tuple[str, ...]
    t_s: Annotated[tuple[Finite, ...], Field(min_length=1)]
    rate_dn_per_s: tuple[Row, ...]
    sigma_dn_per_s: tuple[tuple[NotNegative, ...], ...]
    constant_dn_per_s: Row
    constant_dn_per_s_sigma: tuple[NotNegative, ...]
    ambient_dn_per_s: Row
    ambient_dn_per_s_sigma: tuple[NotNegative, ...]
    first_clean_s: NotNegative | None
    source: str = ""
    run: str | None = None

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        if any(right <= left for left, right in pairwise(self.t_s)):
            raise ValueError("expected rising times in 't_s'")
        rows = (*self.rate_dn_per_s, *self.sigma_dn_per_s)
        levels = (
            self.constant_dn_per_s,
            self.constant_dn_per_s_sigma,
            self.ambient_dn_per_s,
            self.ambient_dn_per_s_sigma,
        )
        if len(self.rate_dn_per_s) != len(self.t_s) or len(self.sigma_dn_per_s) != len(self.t_s):
            raise ValueError("expected a row of rates and of σ for every time in 't_s'")
        if any(len(row) != len(self.channels) for row in (*rows, *levels)):
            raise ValueError(f"expected {len(self.channels)} numbers in each row, one a channel")
        return self

    def is_clean(self, t_s: float) -> bool:
        """Return whether a frame that begins `t_s` after lamp off has no fading light but the glow.

        Raises
        ------
        DataError
            The blank never became free of the turn-off transient.
        """
        if self.first_clean_s is None:
            raise DataError(
                "the blank never became free of the turn-off transient: light other than the glow "
                "fades along with it (see the blank's report, and measure one again with a shield "
                "or for longer)"
            )
        return t_s >= self.first_clean_s - SAME_TIME_S

    def leaks(self) -> tuple[ResultWarning, ...]:
        """Return a warning for each source of constant stray light."""
        warnings = []
        for occasion, level, sigma in (
            ("after lamp off, but not in dark frames", self.constant_dn_per_s,
             self.constant_dn_per_s_sigma),
            ("all the time", self.ambient_dn_per_s, self.ambient_dn_per_s_sigma),
        ):  # fmt: skip
            brightest = int(np.argmax(level))
            if level[brightest] > SIGNIFICANT * sigma[brightest]:
                warnings.append(
                    Disturbance(
                        "stray-light",
                        "light of {light_dn_per_s:.3g} ± {sigma_dn_per_s:.2g} DN/s in {channel} "
                        "falls on the blank {occasion}: find where it leaks in",
                        light_dn_per_s=level[brightest],
                        sigma_dn_per_s=sigma[brightest],
                        channel=self.channels[brightest],
                        occasion=occasion,
                    )
                )
        return tuple(warnings)


BLANK_KIND = CalibrationKind(
    name="blank",
    protocol="blank",
    optics_key="blank",
    file_name="blank.yaml",
    model=BlankFile,
)
