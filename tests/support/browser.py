"""How headless Chromium is started: nothing that asks the network, and a scene drawn by software where it is asked for.

Pages are calm unless they are asked to be drawn, and their errors are heard.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from playwright.sync_api import Error

_QUIET = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync"
).split()
SOFTWARE_GL = (
    *_QUIET,
    *"--use-gl=angle --use-angle=gl-egl --ignore-gpu-blocklist".split(),
    *"--disable-accelerated-2d-canvas --disable-gpu-rasterization".split(),
)
_NO_GL = (*_QUIET, "--disable-gpu")  # of which a page that has no scene to draw is quicker by a third
_CALM = Path(__file__).with_name("calm.js")

# Plotly's own, of a chart whose panel is left while it is being drawn: it goes on drawing what is no longer there.
_NOT_OURS = ("_redrawFromAutoMarginCount",)
WINDOW = {"width": 1400, "height": 900}
_TIMEOUT_MS = 30_000.0  # Playwright's own


class Browser:
    """Chromium by its path, started once for calm pages and once for drawn ones, each when the first is opened."""

    def __init__(self, playwright: Any, path: str) -> None:
        self._playwright, self._path = playwright, path
        self._started: dict[bool, Any] = {}
        self._errors: list[str] = []
        self._idle: list[Any] = []

    @contextlib.contextmanager
    def tab(self) -> Iterator[Any]:
        """A calm tab of 1400 × 900 that has nothing of a test before.

        Where it was used before, what it has compiled makes it load the app in half of the time.
        """
        page = self._idle.pop() if self._idle else self.new_page(viewport=WINDOW)
        yield page
        try:
            page.evaluate("() => { localStorage.clear(); sessionStorage.clear(); }")
            page.goto("about:blank")
            page.context.clear_cookies()
            page.set_viewport_size(WINDOW)
            page.set_default_timeout(_TIMEOUT_MS)
            self._idle.append(page)
        except Error:  # it was closed, or hangs
            page.close()

    def new_page(self, *, drawn: bool = False, **settings: Any) -> Any:
        """Of a context of its own."""
        page = self._chromium(drawn).new_page(**settings)
        self._hear(page)
        if not drawn:
            page.add_init_script(path=_CALM)
        return page

    def new_context(self, **settings: Any) -> Any:
        """Whose pages are calm as well."""
        context = self._chromium(False).new_context(**settings)
        context.on("page", self._hear)
        context.add_init_script(path=_CALM)
        return context

    def errors(self) -> list[str]:
        """What pages have thrown, or written to their console as an error, since this was asked last."""
        heard, self._errors = self._errors, []
        return [one for one in heard if not any(text in one for text in _NOT_OURS)]

    def close(self) -> None:
        """With all its pages."""
        for one in self._started.values():
            one.close()

    def _chromium(self, drawn: bool) -> Any:
        if drawn not in self._started:
            args = SOFTWARE_GL if drawn else _NO_GL
            self._started[drawn] = self._playwright.chromium.launch(executable_path=self._path, args=args)
        return self._started[drawn]

    def _hear(self, page: Any) -> None:
        page.on("pageerror", lambda error: self._errors.append(f"{page.url}: {error}"))
        page.on("console", lambda said: said.type == "error" and self._errors.append(f"{page.url}: {said.text}"))
