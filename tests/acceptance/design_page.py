"""How fast the page of `labrig design` answers while a key is dragged, in a real browser.

    python -m tests.acceptance.design_page [--scene cornell-box [--spread]]

A key is dragged along the time line in steps of one pixel; from each step until the page has drawn
the new material is one answer. Given are the median, the 90th percentile and the slowest; with a
scene, too, the time until its picture is drawn. With `--spread` there is another dot, and each
has a material of its own.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from labrig.studio.scene_bench import SceneBench
from labrig.studio.server import StudioServer
from labrig.studio.workbench import Workbench
from tests.chromium import browser

STEPS = 60
#: Times in s after the light, colours and brightnesses of the keys.
KEYS = ((1, "#20c060", 4e-3), (5, "#20b060", 2e-3), (20, "#20a060", 1e-3), (60, "#209060", 3e-4))
#: Start of the darkness of a page about patches.
DARK_S = 300.0
#: A dot on the left wall of the shipped box.
DOT = (0.1, 0.55)
#: Another one above it, and its glow.
OTHER, OTHER_KEYS = (0.1, 0.25), ((1, "#4060f0", 3e-3), (60, "#4060f0", 8e-4))


def main() -> None:
    """Drag a key, and print how fast the page followed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene")
    parser.add_argument("--spread", action="store_true")
    arguments = parser.parse_args()
    scene: str | None = arguments.scene
    bench = Workbench() if scene is None else SceneBench(scene)
    first = bench.start()
    begin_s, place = (DARK_S, "patch") if scene is None else (0.0, "dot 1")
    if scene is not None:
        first["pixels"] = {place: DOT}
    first["keys"] = [
        {"at": f"{begin_s + after_s} s", "place": place, "colour": colour, "brightness": brightness}
        for after_s, colour, brightness in KEYS
    ]
    if arguments.spread:
        first["scene"]["spread"] = {}
        first["pixels"]["dot 2"] = OTHER
        first["keys"] += [
            {"at": f"{at_s} s", "place": "dot 2", "colour": colour, "brightness": brightness}
            for at_s, colour, brightness in OTHER_KEYS
        ]
    with (
        StudioServer(bench, first) as server,
        server.running(),
        tempfile.TemporaryDirectory() as profile,
        browser(Path(profile)) as chrome,
    ):
        chrome.get(server.url)
        patience = WebDriverWait(chrome, 120, 0.05)
        patience.until(lambda _: chrome.find_elements(By.CSS_SELECTOR, '[data-key="2"] circle'))
        patience.until(lambda _: not chrome.execute_script("return document.body.dataset.busy"))
        chrome.execute_script("performance.clearMeasures()")
        key = chrome.find_element(By.CSS_SELECTOR, '#timeline [data-key="2"] circle')
        actions = ActionChains(chrome, duration=30).click_and_hold(key)
        for number in range(STEPS):
            actions.move_by_offset(1 if number < STEPS // 2 else -1, 0)
        actions.release().perform()
        patience.until(lambda _: not chrome.execute_script("return document.body.dataset.busy"))
        for name in ("answer", "picture"):
            taken_ms = chrome.execute_script(
                "return performance.getEntriesByName(arguments[0]).map((each) => each.duration)",
                name,
            )
            if taken_ms:
                median, most = np.percentile(taken_ms, [50, 90])
                print(
                    f"{name}: {len(taken_ms)} while dragged, median {median:.0f} ms, 90 % within "
                    f"{most:.0f} ms, slowest {max(taken_ms):.0f} ms"
                )


if __name__ == "__main__":
    main()
