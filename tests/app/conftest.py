"""A running app and a page on it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.on_page import wait_until

from emaviz.page.app import App


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """One app on a free port of the loopback."""
    app = App("127.0.0.1", 0, tmp_path_factory.mktemp("data"))
    assert app.wait_for_first_picture(120.0)
    yield app
    app.close()


@pytest.fixture
def page(browser: Any, app: App) -> Iterator[Any]:
    """A browser tab on the app, its controls and charts drawn, that failed on no request to elsewhere."""
    tab = browser.new_page(viewport={"width": 1400, "height": 900})
    asked: list[str] = []
    # An earlier test may have left work that brings another panel to the front when it ends.
    wait_until(lambda: not (app.comparing.running or app.discovering.running or app.session.worker.busy))
    app.session.refresh()  # brings the signals there
    app.strip.play(False)  # software GL draws a moving actuator with most of a core
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(app.address)
    tab.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
    tab.wait_for_function("Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4", timeout=60_000)
    yield tab
    seen = tab.inner_text("body")
    tab.close()
    assert "<style" not in seen and "<div" not in seen, "markup of ours is shown letter by letter"
    outside = [url for url in asked if not url.startswith((app.address, "ws://127.0.0.1", "data:", "blob:"))]
    assert not outside, "nothing may be fetched from elsewhere"


@pytest.fixture
def watched(browser: Any, app: App) -> Iterator[Any]:
    """As `page`, but the Rerun viewer on its own loopback address may be loaded."""
    tab = browser.new_page(viewport={"width": 1400, "height": 900})
    asked: list[str] = []
    tab.on("requestfinished", lambda request: asked.append(request.url))
    tab.goto(app.address)
    tab.get_by_role("tab", name="Recordings").wait_for(timeout=60_000)
    yield tab
    seen = tab.inner_text("body")
    tab.close()
    assert "<style" not in seen and "<div" not in seen, "markup of ours is shown letter by letter"
    assert app.viewer is not None
    allowed = (app.address, app.viewer.address, "ws://127.0.0.1", "data:", "blob:")
    assert any(url.startswith(app.viewer.address) for url in asked)
    assert not [url for url in asked if not url.startswith(allowed)], "nothing may come from elsewhere"
