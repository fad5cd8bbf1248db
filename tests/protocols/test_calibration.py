"""A bench's calibration: its plan, in the order of the bench's arrangements."""

from pathlib import Path

import pytest

from labrig.acquire import Plan, read_protocol
from labrig.fit.lvf import most_informative_filters
from labrig.foundation import resources
from labrig.optics import read_transmittance
from labrig.protocols.calibration.protocol import Calibration
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)


@pytest.fixture(scope="module")
def laid_out() -> Plan:
    return planned(resources.find("protocols", "protocol", "calibration"), "sim-phosphor")


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("calibration", "sim-phosphor")


def test_a_bench_is_calibrated_in_three_hours_and_25_steps_by_hand(laid_out: Plan) -> None:
    assert laid_out.duration_s <= 3 * 3600
    assert len(laid_out.manual_steps) <= 25


def test_all_units_of_the_parts_are_done_once_and_dark_frames_first(laid_out: Plan) -> None:
    parts = read_protocol(resources.find("protocols", "protocol", "calibration"))
    assert isinstance(parts, Calibration)
    alone = {f"{part.name}/{unit.name}" for part in parts.chain() for unit in part.protocol.units()}
    put_back = {name for name in alone if name.endswith("/put-back")}
    filters = {name for name in alone if name.startswith("lvf_calibration/filter-")}
    assert set(laid_out.units) - {"put-back"} >= alone - put_back - filters
    assert len(set(laid_out.units)) == len(laid_out.units)
    lit = next(n for n, name in enumerate(laid_out.units) if name.startswith("blank/blank"))
    assert all("dark" in name for name in laid_out.units[:lit])
    assert not any("dark" in name for name in laid_out.units[lit:])


def test_neighbouring_edges_and_grey_filters_tell_least() -> None:
    folder = resources.folder("config/optics/filters")
    filters = [read_transmittance(path) for path in sorted(folder.glob("*.csv"))]
    chosen = most_informative_filters(filters, 15)
    assert len(set(chosen)) == 15
    assert not any("neutral" in name for name in chosen)


def test_a_chain_within_a_chain_is_one_clear_line(tmp_path: Path) -> None:
    parts = [{"protocol": "phosphor", "parts": [{"protocol": "fade"}]}]
    said = "expected 'protocol: NAME' in every part"
    assert_one_clear_line(written(tmp_path, protocol="calibration", parts=parts), said)
