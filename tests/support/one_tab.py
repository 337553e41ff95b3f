"""A browser tab that the tests of a module share, and that each of them finds as a new one would be."""

from __future__ import annotations

import contextlib
from typing import Any

from playwright.sync_api import Error

from emaviz.page.app import App
from support.browser import WINDOW

CHARTS_DRAWN = "Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4"
BEHIND = "[role=tablist] > [role=tab]:first-child[aria-selected=false]:visible"  # first tabs that are not in front
IN_FRONT = "tab => tab.ariaSelected === 'true' || !tab.isConnected"
MARKED = "window.__viserMutable.nodePoseData['/said_so_far']"
SAID = ".mantine-Notification-closeButton"
# Whether each folder is open, by its title; and what turns those that a test has left otherwise.
FOLDERS = """() => Object.fromEntries(Array.from(document.querySelectorAll('svg[class*=tabler-icon-chevron]'))
  .filter(icon => icon.parentElement.style.cursor === 'pointer')
  .map(icon => [icon.parentElement.textContent, icon.classList.contains('tabler-icon-chevron-up')]))"""
TURN_BACK = """(open) => {
  for (const icon of document.querySelectorAll('svg[class*=tabler-icon-chevron]')) {
    const head = icon.parentElement, before = open[head.textContent];
    if (before !== undefined && before !== icon.classList.contains('tabler-icon-chevron-up')) head.click();
  }
}"""


class Tab:
    """The tab, loaded at its first use; all of it is drawn, the scene where that is asked for."""

    def __init__(self, browser: Any, app: App, scene: bool = False) -> None:
        self._browser, self._app, self._scene = browser, app, scene
        self._page: Any = None
        self._open = contextlib.ExitStack()
        self._folders: dict[str, bool] = {}
        self._asked: list[str] = []

    def as_new(self) -> Any:
        """The page with each group's first tab in front, folders as at first, nothing told, and its charts drawn."""
        if self._page is not None:
            try:
                self._take_back()
                return self._page
            except Error:  # on a loaded machine; a page that is loaded anew is as new, too
                self.close()
        self._load()
        return self._page

    def _load(self) -> None:
        if self._scene:
            self._page = self._browser.new_page(viewport=WINDOW, drawn=True)
            self._open.callback(self._page.close)
        else:
            self._page = self._open.enter_context(self._browser.tab())
        self._page.on("request", self._note)
        self._page.goto(self._app.address)
        self._page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
        self._page.wait_for_function(CHARTS_DRAWN, timeout=60_000)
        self._folders = self._page.evaluate(FOLDERS)

    def _take_back(self) -> None:
        self._page.set_default_timeout(30_000)
        self._page.evaluate(TURN_BACK, self._folders)
        for _ in range(20):
            tab = self._page.query_selector(BEHIND)
            if tab is None:
                break
            with contextlib.suppress(Error):  # the app may put the tab's whole group away meanwhile
                tab.click(timeout=2_000)
                self._page.wait_for_function(IN_FRONT, arg=tab, timeout=2_000)
        while said := self._page.locator(SAID).count():
            self._page.evaluate(f"document.querySelectorAll('{SAID}').forEach(one => one.click())")
            self._page.wait_for_function(f"document.querySelectorAll('{SAID}').length < {said}")
        self._page.wait_for_function(CHARTS_DRAWN)
        self._hear_out()

    def _hear_out(self) -> None:
        """Returns when the tab has taken all that the app has said, which would undo what a test does meanwhile."""
        mark = self._app.server.scene.add_frame("/said_so_far", show_axes=False)
        self._page.wait_for_function(f"{MARKED} !== undefined")
        mark.remove()
        self._page.wait_for_function(f"{MARKED} === undefined")

    def check(self) -> None:
        """No markup of ours is text on the page, and it has asked nobody but the app."""
        seen = self._page.inner_text("body")
        assert "<style" not in seen and "<div" not in seen, "markup of ours is shown letter by letter"
        own = (self._app.address, "ws://127.0.0.1", "data:", "blob:")
        outside = [url for url in self._asked if not url.startswith(own)]
        assert not outside, "nothing may be fetched from elsewhere"

    def close(self) -> None:
        """Ends the tab, and hears no more of it."""
        if self._page is not None:
            self._page.remove_listener("request", self._note)
            self._open.close()
            self._page = None

    def _note(self, request: Any) -> None:
        self._asked.append(request.url)
