"""The live view as a person uses it: a real browser, regions drawn, named and written."""

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.wait import WebDriverWait

from labrig.acquire import CAMERA, LiveView, read_protocol, read_rig_file
from labrig.bench import open_bench
from labrig.foundation.clock import Interrupted
from labrig.setup.view import EditableProtocol, LivePictures, ViewServer, serve_pictures

#: Where screenshots are kept for a person to look at.
SCREENSHOTS = os.environ.get("LABRIG_SCREENSHOTS")
PATIENCE_S = 30


@pytest.fixture
def page(make_rig: Callable[..., Path], make_protocol: Callable[..., Path]) -> Iterator[str]:
    """Address of the page for a simulated rig, whose camera another thread looks through."""
    rig_file = make_rig(base="sim-eleven", sensor={"width": 1404, "height": 936})
    protocol = EditableProtocol(make_protocol(patches={"sample": [0.3, 0.3, 0.4, 0.4]}))
    pictures = LivePictures()
    with (
        open_bench(read_rig_file(rig_file), str(rig_file)) as bench,
        bench.devices() as rig,
        ViewServer(pictures, protocol, rig.name) as server,
        server.running(),
    ):
        camera = rig[CAMERA]
        assert isinstance(camera, LiveView)

        def look() -> None:
            with pytest.raises(Interrupted):
                serve_pictures(pictures, camera, rig.clock)

        looking = threading.Thread(target=look)
        looking.start()
        try:
            yield server.url
        finally:
            rig.clock.interrupt(2)
            looking.join()


class Page:
    def __init__(self, browser: Chrome, url: str) -> None:
        self.browser = browser
        browser.get(url)
        self.wait(lambda: self.one("#status").text.startswith("Live"))

    def wait(self, until: Callable[[], object]) -> None:
        WebDriverWait(self.browser, PATIENCE_S, 0.1).until(lambda _: until())

    def one(self, selector: str) -> WebElement:
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector: str) -> list[WebElement]:
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """From one place to another, in fractions of the picture."""
        stage = self.one("#stage")
        width, height = stage.size["width"], stage.size["height"]

        def offsets(at: tuple[float, float]) -> tuple[int, int]:
            return round((at[0] - 0.5) * width), round((at[1] - 0.5) * height)

        actions = ActionChains(self.browser, duration=20)
        actions.move_to_element_with_offset(stage, *offsets(start)).click_and_hold()
        halfway = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        for at in (halfway, end):
            actions.move_to_element_with_offset(stage, *offsets(at))
        actions.release().perform()

    def screenshot(self, name: str) -> None:
        if SCREENSHOTS:
            self.browser.save_screenshot(f"{SCREENSHOTS}/{name}.png")


def test_regions_are_drawn_named_and_written(chromium: Chrome, page: str, tmp_path: Path) -> None:
    protocol = tmp_path / "protocol.yaml"
    before = protocol.read_text()
    view = Page(chromium, page)
    assert len(view.all("#list li")) == 1, "the protocol's own region is shown"
    assert not view.one("#write").is_enabled()

    view.drag((0.05, 0.06), (0.23, 0.30))
    names = view.all("#list input")
    assert len(names) == 2
    names[1].send_keys(Keys.CONTROL, "a")
    names[1].send_keys("no")  # a truth value to careless YAML
    view.wait(lambda: view.one("#focus-region").is_displayed())
    view.wait(lambda: "% of best" in view.one("#focus-region output").text)
    view.screenshot("view-1200")

    # moved by keys and by the mouse, and resized by its lower right corner
    view.all(".region")[1].send_keys(Keys.ARROW_RIGHT)
    view.drag((0.12, 0.2), (0.22, 0.2))
    view.drag((0.335, 0.30), (0.385, 0.35))
    # the region that was there before is removed
    view.all("#list button")[0].click()
    assert len(view.all("#list li")) == 1
    view.one("#write").click()
    view.wait(lambda: "done" in (view.one("#written").get_attribute("class") or ""))

    patches = read_protocol(protocol).model_dump()["patches"]
    assert list(patches) == ["no"]
    assert patches["no"] == pytest.approx((0.155, 0.06, 0.23, 0.29), abs=0.004)
    assert protocol.read_text().partition("patches:")[0] == before.partition("patches:")[0]
    told = chromium.get_log("browser")  # type: ignore[no-untyped-call]
    severe = [entry for entry in told if entry["level"] == "SEVERE"]
    assert severe == []


def test_two_of_a_name_cannot_be_written(chromium: Chrome, page: str) -> None:
    view = Page(chromium, page)
    view.one("#add").click()
    chromium.switch_to.active_element.send_keys("sample")
    assert "Two regions are called" in view.one("#written").text
    assert not view.one("#write").is_enabled()


def test_everything_fits_on_a_phone(chromium: Chrome, page: str) -> None:
    chromium.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True},
    )
    chromium.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    view = Page(chromium, page)
    view.drag((0.55, 0.4), (0.7, 0.6))
    wide = chromium.execute_script("return document.documentElement.scrollWidth")
    assert wide == 390
    if SCREENSHOTS:
        view.wait(lambda: view.one("#clipped").text)
        chromium.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": 390, "height": 1500, "deviceScaleFactor": 2, "mobile": True},
        )
        view.screenshot("view-390")
