"""Library on the page: that its long run waits in line stands beside its button."""

from __future__ import annotations

import pytest
from support.on_page import wait_until

from emaviz.page.library import LibraryTab

pytestmark = pytest.mark.browser


def test_an_effect_is_drawn_against_what_it_follows(shared_page, app):
    page = shared_page
    page.get_by_role("tab", name="Library", exact=True).click()
    for effect, variable in (("Cogging torque", "motor angle"), ("Constant load", "motor speed")):
        page.get_by_role("button", name=effect).locator("visible=true").first.click()
        picture = page.get_by_role("img", name=f"Residual current against {variable}")
        picture.wait_for(timeout=60_000)
        assert picture.locator("path[stroke='#e03131']").get_attribute("d").count("M") > 100


def test_pictures_that_wait_in_line_are_told_beside_their_button(shared_page, app, monkeypatch):
    page = shared_page
    page.get_by_role("tab", name="Library", exact=True).click()
    button = page.get_by_role("button", name="Simulate all for their thumbnails")
    wait_until(lambda: button.is_visible() and not app.session.worker.busy, 60.0)
    free = []
    monkeypatch.setattr(app.tab(LibraryTab)._library, "draw_all", lambda: bool(free))  # none, while another goes on
    button.click()
    page.locator(".emaviz-beside").filter(has_text="In line: begins after the run before").wait_for()
    free.append(True)
    page.locator(".emaviz-beside").wait_for(state="detached")
