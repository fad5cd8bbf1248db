from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.errors import DataError, DiskError, LabrigError
from labrig.results import Series, add_flag, parse_series, read_series, write_series

number = st.floats(min_value=-1e100, max_value=1e100)
positive = st.floats(min_value=0, exclude_min=True, max_value=1e100)
maybe = st.one_of(st.just(float("nan")), positive)
plain = st.text(st.characters(exclude_categories=("C", "Z")), max_size=8)
name = plain.filter(lambda text: text and not text.endswith("_sigma"))


@st.composite
def serieses(draw: st.DrawFn) -> list[Series]:
    """Patches as a run gives them: the same channels, each region and unit once."""
    taken = {"t", "time", "time_s", "t_s", "exposure", "exposure_s", "sigma"}
    taken |= {"iso", "f_number", "frame", "unit", "region", "flag"}
    channels = tuple(
        draw(
            st.lists(
                name.filter(lambda text: text.lower() not in taken),
                min_size=1,
                max_size=3,
                unique=True,
            )
        )
    )
    keys = draw(st.lists(st.tuples(plain, plain), min_size=1, max_size=3, unique=True))
    return [_drawn(draw, channels, region, unit) for region, unit in keys]


def _drawn(draw: st.DrawFn, channels: tuple[str, ...], region: str, unit: str) -> Series:
    n, c = draw(st.integers(1, 4)), len(channels)

    def column(elements: st.SearchStrategy[float], *shape: int) -> Any:
        size = int(np.prod(shape))
        return np.reshape(draw(st.lists(elements, min_size=size, max_size=size)), shape)

    def texts() -> tuple[str, ...]:
        return tuple(draw(st.lists(plain, min_size=n, max_size=n)))

    return Series(
        t_s=column(number, n),
        exposure_s=np.abs(column(number, n)),
        values=column(number, n, c),
        sigma=column(maybe, n, c),
        dark_sigma=np.full(c, np.nan),
        channels=channels,
        iso=column(maybe, n),
        f_number=column(maybe, n),
        frame=texts(),
        unit=(unit,) * n,
        flag=texts(),
        region=region,
    )


@settings(deadline=None)
@given(written=serieses())
def test_csv_gives_back_what_was_written(
    tmp_path_factory: pytest.TempPathFactory, written: list[Series]
) -> None:
    path = tmp_path_factory.mktemp("series") / "series.csv"
    write_series(path, written)
    read = read_series(path)
    assert len(read) == len(written)
    for one, other in zip(written, read, strict=True):
        for field in ("t_s", "exposure_s", "values", "sigma", "iso", "f_number"):
            assert np.array_equal(getattr(one, field), getattr(other, field), equal_nan=True)
        for field in ("channels", "frame", "unit", "flag", "region", "value_unit"):
            assert getattr(one, field) == getattr(other, field)


SERIES = Series(
    t_s=np.array([0.6, 2.0, 4.0]),
    exposure_s=np.array([0.5, 0.5, 1.0]),
    values=np.array([[10.0, 20.0], [5.0, 10.0], [2.5, 1 / 3]]),
    sigma=np.array([[0.1, 0.2], [0.1, 0.2], [np.nan, 0.1]]),
    dark_sigma=np.array([0.01, 0.02]),
    channels=("R", "G"),
    iso=np.array([100.0, 100.0, 200.0]),
    f_number=np.full(3, np.nan),
    frame=("000001.cr2", "000002.cr2", "000003.cr2"),
    unit=("a", "b", "a"),
    flag=("", "late+clipped", "late"),
    region="paint",
)


def test_the_file_is_as_the_contract_says(tmp_path: Path) -> None:
    write_series(tmp_path / "series.csv", [SERIES])
    assert (tmp_path / "series.csv").read_text().splitlines() == [
        "t_s,exposure_s,R (DN/s),R_sigma (DN/s),G (DN/s),G_sigma (DN/s),iso,f_number,frame,unit,"
        "region,flag",
        "0.6,0.5,10.0,0.1,20.0,0.2,100.0,,000001.cr2,a,paint,",
        "2.0,0.5,5.0,0.1,10.0,0.2,100.0,,000002.cr2,b,paint,late+clipped",
        "4.0,1.0,2.5,,0.3333333333333333,0.1,200.0,,000003.cr2,a,paint,late",
    ]


def test_units_come_apart() -> None:
    first, second = SERIES.by_unit()
    assert (first.unit, second.unit) == (("a", "a"), ("b",))
    assert first.t_s.tolist() == [0.6, 4.0]
    assert first.flag == ("", "late")
    assert [part.unit for part in parse_series(_text(SERIES), "x")] == [first.unit, second.unit]


def _text(series: Series) -> str:
    rows = ["t_s,R,G,unit,region"]
    for t_s, (red, green), unit in zip(series.t_s, series.values, series.unit, strict=True):
        rows.append(f"{t_s},{red},{green},{unit},{series.region}")
    return "\n".join(rows)


def test_flags() -> None:
    assert SERIES.usable.tolist() == [True, False, True]
    assert add_flag("", "clipped") == "clipped"
    assert add_flag("late", "clipped") == "late+clipped"
    assert add_flag("late+clipped", "clipped") == "late+clipped"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"t_s": np.zeros(0)}, "0 rows"),
        ({"values": np.zeros((2, 2))}, "shape"),
        ({"flag": ("",)}, "every column"),
        ({"dark_sigma": np.zeros(3)}, "dark_sigma"),
        ({"t_s": np.array([0, np.nan, 1])}, "finite numbers in t_s"),
        ({"values": np.full((3, 2), np.inf)}, "finite numbers in values"),
        ({"values": np.full((3, 2), -1e303)}, r"values up to 1e\+100"),
        ({"exposure_s": np.array([1.0, -1.0, 1.0])}, "negative"),
        ({"sigma": np.zeros((3, 2))}, "sigma above 0"),
        ({"channels": ("R", "R")}, "'R' cannot name"),
        ({"channels": ("R", "iso")}, "'iso' cannot name"),
        ({"channels": ("R", "R_sigma")}, "cannot name"),
        ({"unit": ("a", "b\n", "a")}, "one line"),
    ],
)
def test_an_impossible_series_cannot_be_made(change: dict[str, Any], why: str) -> None:
    with pytest.raises(DataError, match=why):
        Series(**vars(SERIES) | change)


def test_what_cannot_be_written(tmp_path: Path) -> None:
    other = Series(**vars(SERIES) | {"channels": ("R", "B")})
    with pytest.raises(DataError, match="same channels"):
        write_series(tmp_path / "series.csv", [SERIES, other])
    with pytest.raises(DiskError, match="cannot be written"):
        write_series(tmp_path / "missing" / "series.csv", [SERIES])


@settings(max_examples=60, deadline=None)
@given(text=st.one_of(st.text(), st.from_regex(r"(t|R|\d|[,\t;. #\n\"-]|nan)*", fullmatch=True)))
def test_any_text_is_a_series_or_refused_in_one_line(text: str) -> None:
    try:
        assert all(isinstance(part, Series) for part in parse_series(text, "x.csv"))
    except LabrigError as error:
        assert len(str(error).splitlines()) == 1
