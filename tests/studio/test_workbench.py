"""Answers to the page of `labrig design`: the same designs as from a file, in every frame."""

import json
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.design import Parameters, read_wish, to_wish, written_differences
from labrig.foundation.errors import UsageError
from labrig.material import read_material
from labrig.studio.messages import Asked, timeline_of, wish_content
from labrig.studio.server import StudioServer
from labrig.studio.workbench import Workbench

KEYS = [
    {"at": "301 s", "colour": "#20c060", "brightness": 2e-3},
    {"at": "320 s", "colour": "#20c060", "brightness": 4e-4},
]


def asked(**changes: Any) -> dict[str, Any]:
    return {"wish": Workbench().start() | {"keys": KEYS} | changes}


def test_a_page_designs_as_a_file_does(tmp_path: Path) -> None:
    bench = Workbench()
    answer = bench.look(asked())
    path = tmp_path / "wish.yaml"
    path.write_text(bench.constraints(asked()), encoding="utf-8")
    wish = read_wish(path)
    assert wish_content(wish.file) == wish_content(to_wish(Asked.of(asked()).file(), "test").file)
    design = wish.solve()
    for name in ("k_r_per_s", "k_e_per_s", "reradiation", "albedo"):
        np.testing.assert_allclose(answer["parameters"][name], getattr(design, name), rtol=1e-4)
    np.testing.assert_allclose(
        [key["delta_e"] for key in answer["keys"]], design.delta_e2000, atol=0.006
    )
    material_file = tmp_path / "material.yaml"
    material_file.write_text(bench.material(asked()), encoding="utf-8")
    assert written_differences(design, read_material(material_file)).max() < 0.3


def test_every_frame_has_the_colour_of_its_time() -> None:
    answer = Workbench().look(asked())
    wish = to_wish(Asked.of(asked()).file(), "test")
    design = wish.solve()
    frames_s = np.array(answer["frames_s"])
    shown = np.array(answer["places"][0]["rgb"])
    some = [0, answer["first"][1] - 1, answer["first"][1], 150, len(frames_s) - 1]
    np.testing.assert_allclose(
        shown[some], np.pi * design.rgb_at(0, frames_s[some]), rtol=1e-3, atol=1e-9
    )
    card = np.array(answer["places"][0]["card"])
    np.testing.assert_allclose(card[some[1]], 1.0, atol=1e-3)
    assert (card[some[2] :] == 0).all()


def test_only_keys_that_are_seen_to_be_missed_fight() -> None:
    assert Workbench().look(asked())["conflicts"] == []
    rising = [{"at": f"{301 + n} s", "colour": "#20c060", "brightness": 1e-3 * 4**n}
              for n in range(4)]  # fmt: skip
    answer = Workbench().look(asked(keys=rising))
    pairs = answer["conflicts"]
    assert 1 <= len(pairs) <= 3
    assert len({frozenset(pair) for pair in pairs}) == len(pairs)
    assert all(answer["keys"][missed]["delta_e"] >= 1 for _, missed in pairs)


def test_what_is_set_by_hand_is_judged_not_solved() -> None:
    bench = Workbench()
    solved = bench.look(asked())
    same = bench.look(asked() | {"by_hand": solved["parameters"]})
    np.testing.assert_allclose(
        [key["delta_e"] for key in same["keys"]],
        [key["delta_e"] for key in solved["keys"]],
        atol=0.02,
    )
    brighter = json.loads(json.dumps(solved["parameters"]))
    brighter["reradiation"] = (2 * np.array(brighter["reradiation"])).tolist()
    doubled = bench.look(asked() | {"by_hand": brighter})
    for key, before in zip(doubled["keys"], solved["keys"], strict=True):
        np.testing.assert_allclose(key["got"], 2 * np.array(before["got"]), rtol=1e-3)
    assert doubled["open"] == []


def test_without_keys_something_glows() -> None:
    answer = Workbench().look(asked(keys=[]))
    glow = np.array(answer["places"][0]["rgb"])[answer["first"][1] :]
    assert (glow[:, 1] > 0).all()
    assert (np.diff(glow[:, 1]) < 0).all()
    spectral = Workbench().look(asked(keys=[], bands_nm=[400, 500, 600, 700], states=2))
    assert np.array(spectral["parameters"]["k_e_per_s"]).shape == (2, 3)
    with pytest.raises(UsageError, match="at least one key"):
        Workbench().nearest(asked(keys=[]))


@given(
    durations_s=st.lists(st.floats(1e-3, 1e5), min_size=1, max_size=6),
    last_key=st.floats(0, 2),
)
def test_frames_rise_from_the_first_light_to_after_the_last_key(
    durations_s: list[float], last_key: float
) -> None:
    begin_s = np.concatenate([[0.0], np.cumsum(durations_s)])
    key_s = float(last_key * begin_s[-1])
    light = [
        {"at": f"{at!r} s", "light": "D65" if number % 2 == 0 else "none"}
        for number, at in enumerate(begin_s.tolist())
    ]
    key = {"at": f"{key_s!r} s", "colour": "#808080", "brightness": 0.1}
    wish = to_wish(Asked.of(asked(places={"patch": light}, keys=[key])).file(), "test")
    timeline = timeline_of(wish)
    assert (np.diff(timeline.frames_s) > 0).all()
    np.testing.assert_array_equal(timeline.frames_s[list(timeline.first)], begin_s)
    assert timeline.frames_s[-1] >= key_s


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"keys": [{"at": "nan s", "colour": "#ffffff"}]}, "at"),
        ({"colour": "red"}, "colour"),
        ({"places": {"patch": [{"at": "0 s", "light": "D66"}]}}, "D65"),
        ({"keys": [KEYS[0], {**KEYS[0], "colour": "#c02020"}]}, "keys 1 and 2"),
    ],
)
def test_what_is_wrong_is_one_line(changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(UsageError, match=expected) as caught:
        Workbench().look(asked(**changes))
    assert "\n" not in str(caught.value)


def test_sliders_out_of_range_are_one_line() -> None:
    given_by_hand = {
        "k_r_per_s": [0.1],
        "k_e_per_s": [[1e-3, 1e-3]],
        "reradiation": [[0.1, 0.1]],
        "albedo": [0.5, 0.5],
    }
    with pytest.raises(UsageError, match="those of 2 and 3"):
        Workbench().look(asked() | {"by_hand": given_by_hand})
    with pytest.raises(UsageError, match="k_e"):
        Parameters.checked([0.1], [[1e-3]], [[0.1, 0.1]], [0.5, 0.5])


def test_a_measured_material_is_a_beginning() -> None:
    bench = Workbench()
    wish = asked()["wish"]
    blue = bench.preset({"wish": wish, "name": "blue-paint"})
    measured = read_material("blue-paint").states[0]
    assert blue["k_r_per_s"] == pytest.approx([measured.k_r_per_s], rel=1e-4)
    glow = np.array(bench.look({"wish": wish, "by_hand": blue})["places"][0]["rgb"])[-1]
    assert glow.argmax() == 2
    with pytest.raises(UsageError, match="measured material"):
        bench.preset({"wish": wish, "name": "blue"})


def test_a_file_is_opened_from_its_text() -> None:
    bench = Workbench()
    text = "light: [{at: 0 s, light: A}, {at: 9 s, light: none}]\nkeys: []\n"
    assert bench.open(text)["places"]["patch"][0]["light"] == "A"
    for wrong in ("light: [", "keys: 3", "light: [{at: 0 s, light: A}]\nkey: []"):
        with pytest.raises(UsageError, match="the opened file"):
            bench.open(wrong)


@pytest.mark.drawn
def test_the_server_answers_whom_it_knows() -> None:
    bench = Workbench()
    with StudioServer(bench, bench.start()) as server, server.running():
        where = ("127.0.0.1", server.server_port)

        def reply(
            method: str, path: str, content: object = None, kind: str = "application/json"
        ) -> tuple[int, Any]:
            connection = HTTPConnection(*where, timeout=20)
            body = None if content is None else json.dumps(content)
            connection.request(method, path, body, {"Content-Type": kind})
            response = connection.getresponse()
            data = response.read()
            connection.close()
            is_json = response.headers["Content-Type"] == "application/json"
            return response.status, json.loads(data) if is_json else data

        own = f"/{server.token}/"
        status, begun = reply("GET", own + "start")
        assert (status, begun["wish"]) == (200, bench.start())
        assert "blue-paint" in begun["presets"]
        status, answer = reply("POST", own + "look", asked())
        assert status == 200
        assert len(answer["keys"]) == 2
        status, answer = reply("POST", own + "look", asked(states=3))
        assert status == 400
        assert "states" in answer["error"]
        status, picture = reply("POST", own + "picture.png", asked())
        assert picture[:8] == b"\x89PNG\r\n\x1a\n"
        assert reply("POST", "/other/look", asked())[0] == 403
        assert reply("POST", own + "look", asked(), "text/plain")[0] == 400
        assert reply("POST", own + "else", asked())[0] == 404
