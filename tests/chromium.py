"""A real browser without a window, for pages that people look at."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium.webdriver import Chrome
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    # The first window has no tabs and no address bar: these are pages, drawn by another process.
    "--app=data:,",
)
SIZE = (1200, 820)
# In CI both are installed; there, their absence is a failure of the test.
IS_MISSING = not (os.environ.get("CI") or (CHROMIUM and DRIVER))


@contextmanager
def browser(profile: Path) -> Iterator[Chrome]:
    """Chromium with a new profile, 1200 x 820."""
    options = Options()
    assert CHROMIUM
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    chrome = Chrome(options, Service(DRIVER))
    try:
        chrome.set_window_size(*SIZE)
        yield chrome
    finally:
        chrome.quit()


@contextmanager
def new_window(chrome: Chrome) -> Iterator[Chrome]:
    """The browser at an empty window, 1200 x 820; what was logged before is forgotten."""
    before = chrome.current_window_handle
    chrome.switch_to.new_window("window")
    try:
        chrome.set_window_size(*SIZE)
        chrome.get_log("browser")  # type: ignore[no-untyped-call]
        yield chrome
    finally:
        chrome.close()
        chrome.switch_to.window(before)
