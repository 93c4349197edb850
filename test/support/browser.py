# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A real Chromium without a window, for the tests and measurements of the web console."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

LIMIT_S = 40.0
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--hide-scrollbars",
)  # fmt: skip
OWN_SCHEMES = ("chrome", "data", "about", "devtools")
"""What the browser shows by itself, before the page is there."""

WATCH = """
window.seen = {};
new MutationObserver(() => {
  const head = document.querySelector('#panel-answer h1');
  const word = head && head.childNodes[1] && head.childNodes[1].textContent;
  if (word && !(word in seen)) seen[word] = Date.now();
}).observe(document, {subtree: true, childList: true, characterData: true});
"""
"""Notes when each outcome first stood on the page, by the clock of this machine."""


def missing() -> str:
    """Why there can be no browser, or nothing."""
    try:
        import selenium  # noqa: F401
    except ImportError:
        return "needs selenium: pip install selenium"
    if not (_binary() and shutil.which("chromedriver")):
        return "needs Chromium: apt-get install chromium chromium-driver"
    return ""


def _binary() -> str | None:
    names = ("chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), None)


class Browser:
    """One window; ``driver`` is Selenium's."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def size(self, width: int, height: int) -> None:
        """Make the window this large."""
        self._command(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip

    def theme(self, name: str) -> None:
        """Prefer a dark or a light page."""
        feature = {"name": "prefers-color-scheme", "value": name}
        self._command("Emulation.setEmulatedMedia", features=[feature])

    def media(self, name: str) -> None:
        """Show the page as on ``screen`` or as for ``print``; empty: as the browser does."""
        self._command("Emulation.setEmulatedMedia", media=name)

    def open(self, url: str) -> None:
        """Load a page, and watch its answer from the first moment."""
        self._command("Page.addScriptToEvaluateOnNewDocument", source=WATCH)
        self.driver.get(url)

    def run(self, script: str) -> Any:
        """Value of some JavaScript."""
        return self.driver.execute_script(f"return {script}")

    def text(self, selector: str) -> str:
        """Text of an element, empty where there is none."""
        return str(self.run(f"document.querySelector('{selector}')?.innerText ?? ''"))

    def until(self, what: str, limit_s: float = LIMIT_S) -> None:
        """Wait until some JavaScript is true."""
        from selenium.common.exceptions import TimeoutException
        from selenium.webdriver.support.ui import WebDriverWait

        try:
            WebDriverWait(self.driver, limit_s, poll_frequency=0.02).until(lambda _: self.run(what))
        except TimeoutException:
            raise AssertionError(f"not within {limit_s} s: {what}\n{self._page()}") from None

    def title(self) -> str:
        """Title of the window."""
        return str(self.run("document.title"))

    def until_text(self, selector: str, words: str, limit_s: float = LIMIT_S) -> None:
        """Wait until an element holds these words."""
        found = f"(document.querySelector('{selector}')?.innerText ?? '')"
        self.until(f"{found}.includes({json.dumps(words)})", limit_s)

    def press(self, *keys: str) -> None:
        """Type on the page, wherever the focus is."""
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def heap_bytes(self) -> int:
        """What JavaScript holds after the garbage was collected."""
        self._command("HeapProfiler.collectGarbage")
        metrics = self._command("Performance.getMetrics")["metrics"]
        return int(next(m["value"] for m in metrics if m["name"] == "JSHeapUsedSize"))

    def frames(self) -> float:
        """Frames that the busiest block of strip charts has drawn so far."""
        blocks = "[...document.querySelectorAll('.strips')].map(e => e.frames || 0)"
        return float(max(self.run(blocks)))

    def foreign(self, own: str) -> list[str]:
        """Addresses that the browser asked for and that are not the page's own."""
        asked = []
        for row in self.driver.get_log("performance"):
            event = json.loads(row["message"])["message"]
            if event["method"] == "Network.requestWillBeSent":
                asked.append(event["params"]["request"]["url"])
            elif event["method"] == "Network.webSocketCreated":
                asked.append(event["params"]["url"])
        assert any(urlsplit(url).netloc == own for url in asked), "nothing was logged at all"
        return [u for u in asked if urlsplit(u).netloc != own and _scheme(u) not in OWN_SCHEMES]

    def shot(self, path: Path) -> None:
        """Save a picture of the window."""
        self.driver.save_screenshot(str(path))

    def _command(self, name: str, **arguments: Any) -> Any:
        return self.driver.execute_cdp_cmd(name, arguments)

    def _page(self) -> str:
        """What people would tell of it: where the focus is, what lies above, and the page."""
        focus = self.run("document.activeElement.outerHTML.slice(0, 200)")
        above = self.run("[...document.querySelectorAll('dialog[open]')].map(e => e.innerText)")
        return f"focus: {focus}\ndialogs: {above}\n{self.run('document.body.innerText')}"[:2000]


def _scheme(url: str) -> str:
    return urlsplit(url).scheme.split("-")[0]


@contextmanager
def chromium(width: int = 1440, height: int = 1000) -> Iterator[Browser]:
    """A browser with an empty profile, ended at the end."""
    from selenium import webdriver

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = webdriver.ChromeOptions()
        options.binary_location = str(_binary())
        for flag in (*FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
        service = webdriver.ChromeService(shutil.which("chromedriver"))
        driver = webdriver.Chrome(options=options, service=service)
        try:
            driver.execute_cdp_cmd("Performance.enable", {})
            browser = Browser(driver)
            browser.size(width, height)
            yield browser
        finally:
            driver.quit()
