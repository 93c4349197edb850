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
