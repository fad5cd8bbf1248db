"""The irradiance file: what is written comes back exactly; what does not fit is refused."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.calibration import IRRADIANCE_KIND, IrradianceFile
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import yaml_text
from labrig.optics import Strip

Row = st.tuples(*[st.floats(0, 1e6)] * 2)


def content(**changed: Any) -> dict[str, Any]:
    return {
        "lamp": "halogen",
        "bands_nm": [400.0, 450.0, 500.0],
        "direct": [0.6, 0.8],
        "direct_sigma": [0.0, 0.0],
        "position": [0.25, 0.75],
        "through": [[0.01, 0.0], [0.0, 0.02]],
        "through_sigma": [[1e-4, 1e-5], [1e-5, 1e-4]],
        "scale_sigma": 0.005,
        "ratio": [140.0, 70.0],
        "ratio_sigma": [1.0, 0.5],
        "strip": Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.2, rising=True).model_dump(
            mode="json"
        ),
    } | changed


@given(through=st.tuples(Row, Row), direct=Row, scale=st.floats(1e-9, 1e9))
def test_what_is_written_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    through: tuple[tuple[float, float], tuple[float, float]],
    direct: tuple[float, float],
    scale: float,
) -> None:
    file = IrradianceFile.model_validate(
        content(through=through, direct=direct, vector_length=scale)
    )
    folder = tmp_path_factory.mktemp("irradiance")
    IRRADIANCE_KIND.write(folder, file)
    assert IRRADIANCE_KIND.read(folder / "irradiance.yaml") == file


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"bands_nm": [400.0, 500.0, 450.0]}, "rising numbers in 'bands_nm'"),
        ({"direct": [1.0]}, "expected 2 numbers for each irradiance"),
        ({"through": [[0.0, 0.1]]}, "expected 2 entries"),
        ({"position": [0.7, 0.2]}, "rising numbers in 'position'"),
        ({"ratio": [0.0, 1.0]}, "ratio.0"),
        ({"scale_sgima": 1}, "did you mean 'scale_sigma'"),
    ],
)
def test_a_malformed_file_is_one_line(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    path = tmp_path / "irradiance.yaml"
    path.write_text(yaml_text(content(**changed)))
    with pytest.raises(UsageError, match=said) as caught:
        IRRADIANCE_KIND.read(path)
    assert "\n" not in str(caught.value)
