"""Lines and tables on terminals of any width: nothing is lost and no number is broken."""

import pytest
from hypothesis import given, strategies as st

from labrig.cli.screen import echo_table, laid_out

WORDS = st.text(alphabet="abkλ0123456789.()±×", min_size=1, max_size=12)
LINES = st.lists(st.tuples(st.integers(1, 6), WORDS), min_size=1, max_size=30).map(
    lambda cells: "".join(" " * gap + word for gap, word in cells)
)
HEAD = ("state", "k_r / s⁻¹", "1/k_r / s", "noise")
ROWS = (
    ("1", "0.032000(22)", "31.217(31)", "flicker 98 %, photons 12 %, reading 3 %"),
    ("2", "0.0041(3)", "244(18)", ""),
)


@given(LINES, st.integers(30, 120))
def test_words_are_kept_in_order_within_the_width(line: str, width: int) -> None:
    laid = list(laid_out(line, width))
    assert " ".join(laid).split() == line.split()
    # A quantity may be up to four words, which are not parted.
    assert all(len(part) <= width or len(part.split()) <= 4 for part in laid)


@pytest.mark.parametrize("width", range(30, 70, 3))
def test_a_quantity_is_on_one_line(width: int) -> None:
    line = "a rate of 0.032 ± 0.004 s⁻¹, after 12 min, of 3 × 10⁴ DN/s and 4.1 % of them" * 3
    laid = list(laid_out(line, width))
    assert max(map(len, laid)) <= width
    for quantity in ("0.032 ± 0.004 s⁻¹,", "12 min,", "3 × 10⁴ DN/s", "4.1 %"):
        assert sum(part.count(quantity) for part in laid) == 3


@pytest.mark.parametrize("columns", [30, 40, 50, 80, 120])
def test_a_table_fits_the_terminal(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    echo_table(HEAD, ROWS)
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= columns
    for cell in ("0.032000(22)", "31.217(31)", "98 %", "0.0041(3)", "244(18)"):
        assert cell in printed
    begins = [line.find("flicker") for line in printed.splitlines() if "flicker" in line]
    if columns >= 80:
        assert printed.splitlines()[0].index("noise") == begins[0]


def test_a_file_gets_whole_rows(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    echo_table(HEAD, ROWS)
    assert len(capsys.readouterr().out.splitlines()) == 1 + len(ROWS)
