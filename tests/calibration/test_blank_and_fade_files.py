"""Blank and fade: written, read, asked."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.calibration import (
    BLANK_KIND,
    FADE_KIND,
    BlankFile,
    Change,
    FadeFile,
)
from labrig.foundation.errors import DataError, UsageError
from labrig.results import Transient
from tests.calibration.blanks import BLANK
from tests.quick_yaml import write_quickly

number = st.floats(-1e6, 1e6)


@settings(max_examples=20)
@given(st.data())
def test_a_written_blank_reads_back_as_itself(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    times = data.draw(st.lists(st.floats(0, 1e4), min_size=1, max_size=5, unique=True).map(sorted))
    row = st.lists(number, min_size=2, max_size=2)
    rows = data.draw(st.lists(row, min_size=len(times), max_size=len(times)))
    file = BlankFile.model_validate(
        BLANK.model_dump()
        | {"t_s": times, "rate_dn_per_s": rows, "sigma_dn_per_s": [(1.0, 2.0)] * len(times)}
        | {"first_clean_s": data.draw(st.none() | st.floats(0, 100))}
    )
    folder = tmp_path_factory.mktemp("blank")
    BLANK_KIND.write(folder, file)
    assert BLANK_KIND.read(folder / "blank.yaml") == file


def test_when_a_blank_is_clean_and_what_leaks() -> None:
    assert BLANK.is_clean(2.1)
    # A frame that was planned for that time begins microseconds before or after it.
    assert BLANK.is_clean(2.0)
    assert BLANK.is_clean(2.0 - 1e-6)
    assert not BLANK.is_clean(1.9)
    assert not BLANK.is_clean(0.5)
    assert BLANK.leaks() == ()
    leaking = BLANK.model_copy(update={"ambient_dn_per_s": (0.0, 3.0)})
    (leak,) = leaking.leaks()
    assert (leak.values["light_dn_per_s"], leak.values["channel"]) == (3.0, "G")
    with pytest.raises(DataError, match="never became free"):
        BLANK.model_copy(update={"first_clean_s": None}).is_clean(9.0)


def fade(**changes: object) -> FadeFile:
    fading = Change(t_s=(0.0, 0.1, 0.3), fraction=((1, 1), (0.2, 0.4), (0, 0)), sigma=((0, 0),) * 3)
    return FadeFile.model_validate({"bands_nm": (400, 500, 600), "fade": fading} | changes)


@settings(max_examples=20)
@given(st.lists(st.floats(1e-3, 1.0), min_size=1, max_size=6), st.floats(0, 2))
def test_a_written_fade_reads_back_as_itself(
    tmp_path_factory: pytest.TempPathFactory, steps: list[float], fraction: float
) -> None:
    times = [0.0, *np.cumsum(steps).tolist()]
    rows = [(fraction, fraction / 3)] * len(times)
    file = fade(rise={"t_s": times, "fraction": rows, "sigma": rows})
    folder = tmp_path_factory.mktemp("fade")
    FADE_KIND.write(folder, file)
    assert FADE_KIND.read(folder / "fade.yaml") == file


def test_a_fade_is_what_the_excitation_fit_takes() -> None:
    file = fade()
    transient = Transient.sampled(*file.in_bands(file.fade, file.bands_nm))
    assert transient.duration_s @ transient.fraction == pytest.approx(file.fade.equivalent_s())
    assert file.fade.equivalent_s() == pytest.approx([0.08, 0.11])
    _, fraction = file.in_bands(file.fade, [450, 550])  # one band, about 500 nm
    assert fraction[1] == pytest.approx([0.3])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"bands_nm": (500, 400, 600)}, "rising edges"),
        ({"bands_nm": (400, 500)}, "expected 1 numbers"),
        ({"fade": {"t_s": (0.1, 0.2), "fraction": [[1]] * 2, "sigma": [[0]] * 2}}, "rise from 0"),
        ({"fade": {"t_s": (0, 0.2), "fraction": [[1]], "sigma": [[0]] * 2}}, "for every time"),
    ],
)
def test_a_malformed_fade_is_one_clear_line(
    tmp_path: Path, changes: dict[str, object], said: str
) -> None:
    path = tmp_path / "fade.yaml"
    path.write_text(write_quickly({**fade().model_dump(mode="json"), **_plain(changes)}))
    with pytest.raises(UsageError) as caught:
        FADE_KIND.read(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def _plain(changes: dict[str, object]) -> dict[str, object]:
    return {
        key: {k: list(v) for k, v in value.items()} if isinstance(value, dict) else list(value)  # type: ignore[call-overload]
        for key, value in changes.items()
    }
