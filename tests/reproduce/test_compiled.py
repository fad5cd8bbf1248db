"""Without the extra, what needs compiled functions says what to install."""

import sys

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, read_material
from labrig.reproduce import Field, FieldParameters, WavelengthShift


@pytest.fixture
def without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    for name in ("surface.field_kernels", "transport.shift_kernels"):
        monkeypatch.delitem(sys.modules, f"labrig.reproduce.{name}", raising=False)


@pytest.mark.usefixtures("without_numba")
def test_the_extra_is_named() -> None:
    nm = np.arange(400.0, 701.0, 10.0)
    grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(31, 0.5)))
    said = r"\(numba is missing\): pip install 'labrig\[render\]'$"
    with pytest.raises(UsageError, match=said):
        WavelengthShift(grey, None)
    with pytest.raises(UsageError, match=said):
        Field(FieldParameters.of(read_material("blue-paint")), 1)
