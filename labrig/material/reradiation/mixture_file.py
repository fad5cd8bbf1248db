"""Reading of files that hold a mixture for a re-radiation: `fit.json` and `mixture.json`."""

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.material.reradiation.mixture import ReradiationMixture

#: Most bands of the incident light: a step of 1 nm over all that instruments measure.
MAX_BANDS = 5000


@dataclass(frozen=True, eq=False)
class StoredMixture:
    """A mixture with the bands on which it was fitted.

    Attributes
    ----------
    mixture
        The mixture.
    band_nm
        Width of the bands in nm at whose centres it was fitted.
    measured_input_nm
        Ends in nm of the incident light to which it was fitted; beyond them are only the tails of
        its densities.
    """

    mixture: ReradiationMixture
    band_nm: float
    measured_input_nm: tuple[float, float]

    def input_nm(self) -> FloatArray:
        """Return the centres of the bands of incident light on which it was fitted, in nm (m,)."""
        low, high = self.measured_input_nm
        count = max(2, round((high - low) / self.band_nm))
        return np.asarray(low + self.band_nm * (np.arange(count) + 0.5))

    def output_nm(self, first_nm: float, last_nm: float) -> FloatArray:
        """Return centres of bands in nm that continue those of the input and cover a range (n,).

        Parameters
        ----------
        first_nm, last_nm
            Ends of the range in nm.
        """
        low = self.measured_input_nm[0]
        begin = math.floor((first_nm - low) / self.band_nm)
        end = math.ceil((last_nm - low) / self.band_nm)
        centres = low + self.band_nm * (np.arange(begin, max(end, begin + 2)) + 0.5)
        return np.asarray(centres[centres > 0])

    def to_matrix(
        self, output_nm: FloatArray, reflectance: FloatArray, name: str
    ) -> ReradiationMatrix:
        """Return the mixture at the centres of its bands, zero for light that was not measured.

        Parameters
        ----------
        output_nm
            Centres of the bands of the light that comes back in nm, shape (n,).
        reflectance
            Radiance factor without re-radiation, shape (n,).
        name
            Name of the material.
        """
        return self.mixture.to_matrix(
            self.input_nm(), output_nm, reflectance=reflectance, name=name
        )


def read_mixture(path: str | os.PathLike[str]) -> StoredMixture:
    """Read a mixture that stands for a re-radiation.

    Parameters
    ----------
    path
        Path of a `fit.json` of `labrig fit mixture`, or of a `mixture.json` in the result of a run
        of `led_fluorescence`.

    Returns
    -------
    StoredMixture
        The mixture and the bands on which it was fitted.

    Raises
    ------
    UsageError
        The file cannot be read, is another, or its re-radiation is relative.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_mixture, read_reradiation
    >>> fitted = fit_mixture(read_reradiation("paper.csv"), 2, threshold=1e-3)
    >>> _ = Path("fit.json").write_text(fitted.to_json())
    >>> stored = read_mixture("fit.json")
    >>> stored.band_nm, bool(abs(stored.mixture.scale - fitted.mixture.scale) < 1e-9)
    (10.0, True)
    """
    file = Path(path)
    try:
        content = json.loads(read_text(file, MAX_JSON_BYTES))
        unit = str(content["unit"])
        stored = _stored(content)
    except (
        ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError
    ) as error:  # fmt: skip
        raise UsageError(
            f"{file}: expected the mixture of a re-radiation, as labrig fit mixture writes it, got "
            f"something else ({error!r})"
        ) from None
    if unit != "1/nm":
        raise UsageError(
            f"{file}: expected a re-radiation in 1/nm, got a relative one; fit the mixture to a "
            "matrix in absolute units"
        )
    return stored


def _stored(content: dict[str, Any]) -> StoredMixture:
    band_nm = float(content["band_nm"])
    low, high = (float(end) for end in content["measured_input_nm"])
    if not (0 < band_nm < math.inf and 0 < low < high < math.inf):
        raise ValueError("bands above 0 nm are needed")
    if (high - low) / band_nm > MAX_BANDS:
        raise ValueError(f"more than {MAX_BANDS} bands")
    parts = content["components"]
    skews = [part["skew"] for part in parts if "skew" in part]
    mixture = ReradiationMixture(
        float(content["scale"]) / band_nm,
        np.array([part["weight"] for part in parts], dtype=np.float64),
        np.array([part["mean"] for part in parts], dtype=np.float64),
        np.array([part["covariance"] for part in parts], dtype=np.float64),
        np.array(skews, dtype=np.float64) if skews else None,
    )
    return StoredMixture(mixture, band_nm, (low, high))
