"""The changer arranges the bench line by line; what was once so stays so."""

import pytest

from labrig.acquire import Changer, read_rig_file
from labrig.bench import open_bench
from labrig.foundation import resources
from labrig.foundation.errors import DeviceError, UsageError
from labrig.sim import open_room
from labrig.sim.arrangement import Arrangement, Arrangements
from labrig.sim.boards import ChangerBoard
from tests.sim.darkroom import LVF, SMALL, Darkroom


def test_the_past_stays_as_it_was() -> None:
    first = Arrangements().changed(10.0, lvf="on sample").changed(20.0, filter="minus-505")
    later = first.changed(20.0, card="blank").changed(30.0, filter=None)
    assert later.at(9.9) == Arrangement()
    assert later.at(10.0) == first.at(19.0) == Arrangement(lvf="on sample")
    assert later.at(25.0) == Arrangement("blank", "on sample", filter="minus-505")
    assert [(left, right) for left, right, _ in later.spans(5.0, 40.0)] == [
        (5.0, 10.0), (10.0, 20.0), (20.0, 30.0), (30.0, 40.0),
    ]  # fmt: skip
    assert list(later.spans(20.0, 30.0)) == [(20.0, 30.0, later.at(20.0))]
    assert later.changed(40.0, filter=None) is later


@pytest.mark.parametrize(
    ("task", "found"),
    [
        ("grey card", Arrangement(card="grey card")),
        ("colorchecker", Arrangement(card="colorchecker")),
        ("blank", Arrangement(card="blank")),
        ("lvf before camera", Arrangement(lvf="before camera")),
        ("lvf on sample", Arrangement(lvf="on sample")),
        ("filter minus-505", Arrangement(filter="minus-505")),
        ("lamp mercury", Arrangement(lamp="mercury")),
        ("lamp at 1.41 m", Arrangement(lamp_m=1.41)),
        ("tilt 40", Arrangement(tilt_deg=40)),
    ],
)
def test_every_task_and_back(task: str, found: Arrangement) -> None:
    bench = Darkroom(lvf=LVF)
    bench.do(task)
    assert bench.arranged == found
    bench.do("sample", "lvf away", "no filter", "lamp halogen", "lamp back", "tilt 0")
    assert bench.arranged == Arrangement()


@pytest.mark.parametrize(
    ("task", "said"),
    [
        ("filter longpas-570", "did you mean 'longpass-570'"),
        ("filter", "known: fresh sample, sample, lit sample, grey card"),
        ("tilt -5", "whole degrees from 0 to 85"),
        ("tilt 90", "whole degrees from 0 to 85"),
        ("lamp at 2 km", "expected 0.2 m or more"),
        ("lamp at 0.0 m", "expected 0.2 m or more"),
        ("lvf on sample", "no LVF in this room"),
        ("dance", "filter NAME"),
    ],
)
def test_what_hands_cannot(task: str, said: str) -> None:
    bench = Darkroom()
    with pytest.raises(UsageError) as refusal:
        bench.do(task)
    assert said in str(refusal.value)
    assert ChangerBoard(bench.room.tasks).receive(f"{task}\n".encode()).startswith(b"cannot ")
    assert bench.arranged == Arrangement()


def test_the_bench_is_found_as_hands_had_left_it() -> None:
    initial = {"manual_steps": ["lvf on sample", "filter minus-505"]}
    content = {**SMALL, "lvf": LVF, "initial": initial}
    with open_room(content, "rig.yaml") as opened:
        assert opened.room.arrangements.at(0.0) == Arrangement(lvf="on sample", filter="minus-505")
    with (
        pytest.raises(UsageError, match="known: fresh sample"),
        open_room({**SMALL, "initial": {"manual_steps": ["dance"]}}, "rig.yaml"),
    ):
        pass


def test_the_shipped_rig_has_hands_that_do_it() -> None:
    path = resources.folder("config") / "sim-phosphor.yaml"
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as rig:
        changer = rig.devices["changer"]
        assert isinstance(changer, Changer)
        changer.do("lvf on sample")
        changer.do("filter longpass-570")
        assert bench.room is not None
        arranged = bench.room.room.arrangements.last
        with pytest.raises(DeviceError, match="cannot tilt a bit; expected whole degrees"):
            changer.do("tilt a bit")
    assert (arranged.lvf, arranged.filter) == ("on sample", "longpass-570")


def test_a_filter_that_is_skipped_leaves_the_one_before_in() -> None:
    bench = Darkroom(faults=[{"filter_skipped": {"name": "minus-505"}}])
    bench.do("filter longpass-570", "filter minus-505")
    assert bench.arranged.filter == "longpass-570"
    bench.do("filter minus-470", "no filter")
    assert bench.arranged.filter is None


def test_an_lvf_is_put_in_the_wrong_way_round_while_the_fault_lasts() -> None:
    bench = Darkroom(lvf=LVF, faults=[{"lvf_turned": {"at": "10 s", "for": "10 s"}}])
    turned = []
    for at_s in (5.0, 15.0, 25.0):
        bench.clock.spend(at_s - bench.clock.now())
        bench.do("lvf away", "lvf before camera")
        turned.append(bench.arranged.turned)
    assert turned == [False, True, False]
