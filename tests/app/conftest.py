"""A running app and a page on it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from support.browser import WINDOW
from support.on_page import wait_until
from support.one_tab import Tab

from ema_model.identification import search
from ema_model.models import closed_loop, inverse_dynamics
from ema_model.simulation import pack
from emaviz.page.app import App
from emaviz.session import compare
from emaviz.session.jobs import Worker


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """One app on a free port of the loopback."""
    app = App("127.0.0.1", 0, tmp_path_factory.mktemp("data"))
    assert app.wait_for_first_picture(120.0)
    yield app
    app.close()


@pytest.fixture
def page(new_page: Any) -> Any:
    """A new tab; a module whose tests can share one says so by a `page` of its own that is `shared_page`."""
    return new_page


@pytest.fixture
def new_page(browser: Any, app: App) -> Iterator[Any]:
    """A browser tab of the test's own on the app, its controls and charts drawn; it may ask nobody else."""
    tab = Tab(browser, app)
    _at_rest(app)
    yield tab.as_new()
    tab.check()
    tab.close()


@pytest.fixture(scope="module")
def tab(browser: Any, app: App) -> Iterator[Tab]:
    """One browser tab on the app for all tests of a module: a load of the page takes seconds of a core."""
    tab = Tab(browser, app)
    yield tab
    tab.close()


@pytest.fixture
def shared_page(tab: Tab, app: App) -> Iterator[Any]:
    """As `page`, in the module's one tab: what a test has opened, chosen and been told there is taken back."""
    _at_rest(app)
    yield tab.as_new()
    tab.check()


def _at_rest(app: App) -> None:
    """Waits for work of an earlier test, which brings another panel to the front when it ends; then the signals are."""
    wait_until(lambda: not (app.comparing.running or app.discovering.running or app.session.worker.busy))
    app.session.refresh()
    app.strip.play(False)  # software GL draws a moving actuator with most of a core


@pytest.fixture
def watched(browser: Any, app: App) -> Iterator[Any]:
    """As `page`, but the Rerun viewer on its own loopback address may be loaded."""
    tab = browser.new_page(drawn=True, viewport=WINDOW)
    asked: list[str] = []
    tab.on("requestfinished", lambda request: asked.append(request.url))
    tab.goto(app.address)
    tab.get_by_role("tab", name="Runs").wait_for(timeout=60_000)
    yield tab
    seen = tab.inner_text("body")
    tab.close()
    assert "<style" not in seen and "<div" not in seen, "markup of ours is shown letter by letter"
    assert app.viewer is not None
    allowed = (app.address, app.viewer.address, "ws://127.0.0.1", "data:", "blob:")
    assert any(url.startswith(app.viewer.address) for url in asked)
    assert not [url for url in asked if not url.startswith(allowed)], "nothing may come from elsewhere"


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is simulated, and which kernels are asked for, by the name of what does it."""
    calls: list[str] = []

    def watch(module: Any, name: str) -> None:
        plain = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, **more: calls.append(name) or plain(*given, **more))

    for name in ("traced", "simulate_references", "own_stack", "stack_at_hand"):
        watch(closed_loop, name)
    for name in ("needed_currents", "stack_at_hand"):
        watch(inverse_dynamics, name)
    watch(search, "exclusive")
    watch(pack, "find_stack")
    return calls


@pytest.fixture
def errors() -> list[Any]:
    """What the compute thread of `worker` could not do."""
    return []


@pytest.fixture
def worker(errors: list[Any]) -> Iterator[Worker]:
    """A compute thread of the test's own."""
    worker = Worker("test-compute", errors.append)
    yield worker
    worker.close()


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Compare reads no file before this is set."""
    go_on, plain = threading.Event(), compare.read_opened
    monkeypatch.setattr(compare, "read_opened", lambda *asked: go_on.wait(30.0) and plain(*asked))
    yield go_on
    go_on.set()
