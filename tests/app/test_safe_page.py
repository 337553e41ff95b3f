"""In a browser: the page works under its policy, speaks to its own server alone, and comes in by its token."""

from __future__ import annotations

import http.server
import threading

import pytest
from support.on_page import field, wait_until

from emaviz.server.access import Door
from emaviz.server.safe_server import open_server

pytestmark = pytest.mark.browser

ASK = "(url) => fetch(url, {mode: 'no-cors'}).then(() => 'answered', () => 'refused')"
CONNECT = """(url) => new Promise(done => {
  try {
    const plug = new WebSocket(url);
    plug.onopen = () => done('answered');
    plug.onerror = () => done('refused');
  } catch (error) { done('refused'); }
})"""
FRAME = """(url) => new Promise(done => {
  const frame = document.createElement('iframe');
  document.addEventListener('securitypolicyviolation', event => done(event.violatedDirective), {once: true});
  frame.onload = () => setTimeout(() => done('shown'), 500);
  frame.src = url;
  document.body.append(frame);
})"""


@pytest.fixture
def elsewhere():
    """Another server of this machine, as (its port, the requests that it got)."""
    asked = []

    class Answer(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            """Silent."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Answer)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_address[1], asked
    server.shutdown()
    server.server_close()


@pytest.mark.long
@pytest.mark.page_errors
def test_the_page_works_under_its_policy_and_reaches_no_other_port(browser, app, elsewhere):
    port, asked = elsewhere
    app.session.refresh()
    page, said = browser.new_page(viewport={"width": 1400, "height": 900}), []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(app.address)
    page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
    page.wait_for_function("Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4", timeout=60_000)
    for tab in ("Identify", "Compare", "Discover", "Library", "Runs", "Explore"):
        page.get_by_role("tab", name=tab, exact=True).click()
    page.get_by_label("Dark", exact=True).check()
    page.get_by_label("Dark", exact=True).uncheck()
    blamed = [line for line in said if "Content Security Policy" in line or "violates" in line]
    assert not blamed
    for host in ("127.0.0.1", "localhost"):
        assert page.evaluate(ASK, f"http://{host}:{port}/fetched") == "refused"
        assert page.evaluate(CONNECT, f"ws://{host}:{port}/connected") == "refused"
    assert page.evaluate(FRAME, f"http://127.0.0.1:{port}/framed") == "frame-src"
    assert not asked
    assert page.evaluate(ASK, app.address) == "answered"
    assert page.evaluate(FRAME, app.viewer.address) == "shown"
    page.close()


@pytest.mark.page_errors  # of what is refused without the token
def test_a_page_comes_in_by_its_token_and_stays_by_its_cookie(browser):
    door = Door("127.0.0.1", ["localhost"])
    server = open_server("127.0.0.1", 0, door)
    slider = server.gui.add_slider("Speed", 0.0, 1.0, 0.1, 0.3)
    try:
        context = browser.new_context()
        page = context.new_page()
        page.goto(door.address(server.get_port()))
        assert "open the address that the app printed" in page.inner_text("body")
        page.goto(door.entry(server.get_port()))
        field(page, "Speed").wait_for(timeout=60_000)
        field(page, "Speed").fill("0.7")
        wait_until(lambda: slider.value == 0.7, 30.0)
        page.close()
        again = context.new_page()  # with the cookie alone
        again.goto(door.address(server.get_port()))
        field(again, "Speed").wait_for(timeout=60_000)
        wait_until(lambda: field(again, "Speed").input_value() == "0.7", 30.0)
        assert "token" not in again.evaluate("document.cookie")
        context.close()
    finally:
        server.stop()
