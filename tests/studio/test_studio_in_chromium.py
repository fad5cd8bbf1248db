"""The page of `labrig design` as a person uses it, in a real browser."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.wait import WebDriverWait

from labrig.design import read_wish, written_differences
from labrig.foundation.yaml_file import parse_yaml
from labrig.material import read_material
from labrig.studio.scene_bench import SceneBench
from labrig.studio.server import StudioServer
from labrig.studio.workbench import Workbench
from tests.design.small_scene import corner
from tests.design.spread_keys import OBJECTS, PIXELS, keys

#: Where screenshots are kept for a person to look at.
SCREENSHOTS = os.environ.get("LABRIG_SCREENSHOTS")
PATIENCE_S = 30


@pytest.fixture
def page() -> Iterator[str]:
    bench = Workbench()
    with StudioServer(bench, bench.start()) as server, server.running():
        yield server.url


class Page:
    def __init__(self, browser: Chrome, url: str, downloads: Path, first: str = "glow") -> None:
        self.browser = browser
        self.downloads = downloads
        browser.execute_cdp_cmd(
            "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(downloads)}
        )
        browser.get(url)
        self.wait(lambda: first in self.one("#status").text)

    def wait(self, until: object) -> None:
        assert callable(until)
        WebDriverWait(self.browser, PATIENCE_S, 0.05).until(lambda _: until())

    def one(self, selector: str) -> WebElement:
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector: str) -> list[WebElement]:
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def settle(self) -> None:
        """Wait until the last change is answered."""
        self.wait(lambda: not self.browser.execute_script("return document.body.dataset.busy"))

    def give(self, name: str, value: str, *, is_over: bool = True) -> None:
        """Move a slider, or choose a colour: what no key press does exactly."""
        self.browser.execute_script(
            "const field = document.getElementById(arguments[0]); field.value = arguments[1];"
            "field.dispatchEvent(new Event('input', {bubbles: true}));"
            "if (arguments[2]) field.dispatchEvent(new Event('change', {bubbles: true}));",
            name,
            value,
            is_over,
        )
        self.settle()

    def set_key(self, frame: int, colour: str, luminance: float) -> None:
        self.give("frame", str(frame))
        self.one("#picture").click()
        self.settle()
        self.give("key-colour", colour)
        self.give("key-luminance", str(luminance))

    def download(self, button: str, name: str) -> Path:
        self.one(button).click()
        path = self.downloads / name
        self.wait(path.exists)
        return path

    def strokes(self) -> dict[str, Any]:
        """Return the strokes of the wish as the page saves it."""
        path = self.download("#save-constraints", "paint-keys.yaml")
        saved = parse_yaml(path.read_text(encoding="utf-8"), "keys")
        path.unlink()
        return dict(saved["scene"]["spread"].get("strokes", {}))

    def screenshot(self, name: str) -> None:
        if SCREENSHOTS:
            self.browser.save_screenshot(f"{SCREENSHOTS}/{name}.png")


@pytest.fixture
def page_of_scene(tmp_path: Path) -> Iterator[str]:
    bench = SceneBench(str(corner(tmp_path)), "paint", width_px=24, paths=8)
    with StudioServer(bench, bench.start()) as server, server.running():
        yield server.url


def severe(browser: Chrome) -> list[object]:
    told = browser.get_log("browser")  # type: ignore[no-untyped-call]
    return [entry for entry in told if entry["level"] == "SEVERE"]


def test_three_keys_are_set_dragged_undone_and_met(
    chromium: Chrome, page: str, tmp_path: Path
) -> None:
    view = Page(chromium, page, tmp_path)
    view.set_key(110, "#20c060", -3)
    view.set_key(150, "#2098a0", -3.7)
    view.set_key(185, "#2060c0", -4.5)
    view.give("states", "2")
    assert len(view.all("#keys li")) == 3
    assert view.one("#key-title").text == "Key 3"

    # the second is dragged to a later time, and back by one undo
    before = view.all("#keys li")[1].text
    key = view.one('#timeline [data-key="1"] circle')
    ActionChains(chromium, duration=20).click_and_hold(key).move_by_offset(30, 0).move_by_offset(
        30, 4
    ).release().perform()
    view.settle()
    assert view.all("#keys li")[1].text != before
    view.screenshot("design-dragged")
    chromium.find_element(By.TAG_NAME, "body").send_keys(Keys.CONTROL, "z")
    view.settle()
    assert view.all("#keys li")[1].text == before
    view.one("#redo").click()
    view.settle()
    assert view.all("#keys li")[1].text != before
    view.one("#undo").click()
    view.settle()

    # another light
    strength = view.one("#light-strength")
    strength.send_keys(Keys.CONTROL, "a")
    strength.send_keys("3", Keys.TAB)
    view.settle()
    assert "× 3" in view.one('#timeline [data-light="0"]').text

    keys_file = view.download("#save-constraints", "design-keys.yaml")
    material_file = view.download("#save-material", "design.yaml")
    wish = read_wish(keys_file)
    assert wish.programme.irradiance[0, 0].max() == pytest.approx(3, abs=0.01)
    assert wish.keys.count == 3
    assert written_differences(wish.solve(), read_material(material_file)).max() < 2
    assert severe(chromium) == []


def test_by_keyboard_alone_in_red(chromium: Chrome, page: str, tmp_path: Path) -> None:
    view = Page(chromium, page, tmp_path)
    picture = view.one("#picture")
    picture.send_keys(Keys.PAGE_DOWN, Keys.ARROW_LEFT, Keys.ENTER)
    view.wait(lambda: view.one("#key").is_displayed())
    view.settle()
    at = view.one("#key-time").get_attribute("value")
    view.one('#timeline [data-key="0"]').send_keys(Keys.ARROW_RIGHT, Keys.ARROW_UP)
    view.settle()
    assert view.one("#key-time").get_attribute("value") != at
    view.one("#theme").send_keys(Keys.ENTER)
    red, green, blue = chromium.execute_script(
        "return getComputedStyle(document.body).color.match(/\\d+/g).map(Number)"
    )
    assert red > 150
    assert max(green, blue) < 40
    view.screenshot("design-red")
    # a slider gives the material by hand, which is judged; then it is solved again
    slider = view.one("#parameters input")
    slider.send_keys(Keys.PAGE_UP)
    view.settle()
    assert view.one("#by-hand").is_displayed()
    view.one("#solve").click()
    view.settle()
    assert not view.one("#by-hand").is_displayed()
    view.one('#timeline [data-key="0"]').send_keys(Keys.DELETE)
    view.settle()
    assert view.all("#keys li") == []
    assert severe(chromium) == []


def test_a_wrong_light_is_said_and_nothing_is_lost(
    chromium: Chrome, page: str, tmp_path: Path
) -> None:
    view = Page(chromium, page, tmp_path)
    view.set_key(150, "#20c060", -3)
    light = view.one("#light-name")
    light.send_keys(Keys.CONTROL, "a")
    light.send_keys("D66", Keys.TAB)
    view.wait(lambda: view.one("#message").is_displayed())
    assert "D65" in view.one("#message").text
    view.one("#undo").click()
    view.settle()
    assert not view.one("#message").is_displayed()
    assert len(view.all("#keys li")) == 1
    # a file of keys is opened in place of them
    path = tmp_path / "mine.yaml"
    path.write_text("light: [{at: 0 s, light: A}]\nkeys: []\n", encoding="utf-8")
    view.one("#open").send_keys(str(path))
    view.wait(lambda: not view.all("#keys li"))
    assert view.one('#timeline [data-light="0"]').text.startswith("0 s")
    view.give("frame", "199")
    wide = chromium.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    assert wide


def test_dots_on_a_picture_of_a_scene(chromium: Chrome, page_of_scene: str, tmp_path: Path) -> None:
    view = Page(chromium, page_of_scene, tmp_path)
    picture = view.one("#picture")

    def offsets(x: float, y: float) -> tuple[int, int]:
        size = picture.size
        return round((x - 0.5) * size["width"]), round((y - 0.5) * size["height"])

    def click(x: float, y: float) -> None:
        ActionChains(chromium).move_to_element_with_offset(
            picture, *offsets(x, y)
        ).click().perform()

    view.give("frame", "130")
    view.wait(lambda: picture.size["width"] == picture.size["height"])
    click(0.5, 0.62)
    view.wait(lambda: view.all("#keys li"))
    view.settle()
    # nothing is wished for on the wall, which is said
    click(0.5, 0.2)
    view.wait(lambda: "'wall'" in view.one("#message").text)
    assert len(view.all("#keys li")) == 1
    # the dot is dragged along the floor
    ActionChains(chromium, duration=20).move_to_element_with_offset(
        picture, *offsets(0.5, 0.62)
    ).click_and_hold().move_by_offset(-10, 4).move_by_offset(-20, 6).release().perform()
    view.settle()
    view.wait(lambda: not view.one("#message").is_displayed())
    wish = view.download("#save-constraints", "paint-keys.yaml").read_text()
    assert len(view.all("#keys li")) == 1
    x, y = (float(word) for word in wish.split("dot 1:")[1].split()[1:4:2])
    assert x == pytest.approx(0.5 - 30 / picture.size["width"], abs=0.02)
    assert y == pytest.approx(0.62 + 10 / picture.size["height"], abs=0.02)
    view.wait(lambda: not chromium.execute_script("return document.body.dataset.painting"))
    view.screenshot("design-scene")
    # off the floor it goes back, and by keys another one is set
    across, down = offsets(x, y)
    ActionChains(chromium, duration=20).move_to_element_with_offset(
        picture, across, down
    ).click_and_hold().move_by_offset(5, -100).move_by_offset(5, -60).release().perform()
    view.wait(lambda: "stays on the material" in view.one("#message").text)
    view.settle()
    assert chromium.execute_script("return document.body.dataset.refused") is None
    for _ in range(8):
        picture.send_keys(Keys.SHIFT, Keys.ARROW_DOWN)
    picture.send_keys(Keys.ENTER)
    view.wait(lambda: len(view.all("#keys li")) == 2)
    view.settle()
    level = view.one("#lamps input")
    level.send_keys(Keys.CONTROL, "a")
    level.send_keys("0.5", Keys.TAB)
    view.settle()
    assert "0.5" in view.one('#timeline [data-light="0"]').text


def test_a_stroke_on_a_scene_is_kept_and_undone(chromium: Chrome, tmp_path: Path) -> None:
    bench = SceneBench(str(corner(tmp_path, objects=OBJECTS)), "paint")
    first = bench.start()
    first["pixels"], first["keys"] = PIXELS, keys()
    with StudioServer(bench, first) as server, server.running():
        view = Page(chromium, server.url, tmp_path, "ΔE2000")
        view.give("spread", "own")
        assert "met" in view.one("#status").text
        view.one("#paint").click()
        picture = view.one("#picture")
        chromium.execute_script("arguments[0].scrollIntoView({block: 'start'})", picture)
        across, down = picture.size["width"] / 2, picture.size["height"] / 2
        ActionChains(chromium, duration=20).move_to_element_with_offset(
            picture, int(-0.2 * across), int(0.5 * down)
        ).click_and_hold().move_by_offset(0, 40).move_by_offset(0, 40).release().perform()
        view.settle()
        view.screenshot("design-spread")
        (strokes,) = view.strokes().values()
        assert list(view.strokes()) == ["left"]
        assert len(strokes) >= 6
        view.one("#undo").click()
        view.settle()
        assert view.strokes() == {}
        assert len(view.all("#keys li")) == len(first["keys"])
        assert severe(chromium) == []
