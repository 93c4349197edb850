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

"""What axe finds wrong with a page for people who cannot see, hear or point."""

from __future__ import annotations

from importlib.resources import files

from support.browser import Browser

SIZES = ((1920, 1080), (1300, 900), (820, 1180), (390, 844))
THEMES = ("light", "dark")


def findings(browser: Browser, ready: str) -> list[tuple[object, ...]]:
    """Findings in both themes and at all sizes; ``ready`` is true once the page is drawn."""
    axe = (files("axe_core_python") / "axe.min.js").read_text("utf-8")
    found: list[tuple[object, ...]] = []
    for theme in THEMES:
        browser.theme(theme)
        for width, height in SIZES:
            browser.size(width, height)
            browser.open(browser.driver.current_url)
            browser.until(f"innerWidth === {width} && {ready}")
            browser.driver.execute_script(axe)
            browser.run("(axe.run().then((r) => { window.axed = r.violations; }), true)")
            browser.until("!!window.axed")
            found += [
                (theme, width, broken["id"], broken["nodes"][0]["html"])
                for broken in browser.run("window.axed")
            ]
    return found
