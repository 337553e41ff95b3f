"""What a slider's change sends to a browser: each chart once, decimated to its pixels, in single precision."""

from __future__ import annotations

import pytest
from support.on_page import wait_until

pytestmark = pytest.mark.browser

MOST_BYTES = 40_000
DRAWN = """() => { const { chart } = Object.values(window.__viserTestpoints.uplots).find(({ chart }) =>
  chart.root.querySelector('.u-title')?.textContent === 'User position');
  return { values: chart.data.map(one => Array.from(one)), y: [chart.scales.y.min, chart.scales.y.max],
           apart: [chart.scales.difference.min, chart.scales.difference.max] }; }"""


def test_a_change_sends_each_chart_once(browser, app):
    with browser.tab() as page:
        received: list[int] = []
        page.on("websocket", lambda one: one.on("framereceived", lambda data: received.append(len(data))))
        page.goto(app.address)
        page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
        page.wait_for_function("Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4", timeout=60_000)
        app.strip.play(False)
        page.wait_for_timeout(2000)  # what a new page is told besides
        sizes = []
        for k in (0.2, 0.3, 0.4):
            received.clear()
            before = app.session.simulation
            app.session.settings.set_fault(0, k)
            app.session.refresh()
            wait_until(lambda before=before: app.session.simulation is not before)
            page.wait_for_timeout(900)
            sizes.append(sum(received))
        print(f"\na change of a slider: {sorted(sizes)[1] / 1e3:.1f} kB")
        assert 10_000 < sorted(sizes)[1] <= MOST_BYTES

        drawn = page.evaluate(DRAWN)
        time, apart, frozen, plant, monitor, command, frame = drawn["values"]
        assert len({len(one) for one in drawn["values"]}) == 1 and len(time) > 300
        assert frozen == plant and len(monitor) == len(command), "it lies unseen beneath"
        assert drawn["apart"][0] <= min(frame) < 2.9 * min(apart) and drawn["apart"][1] >= max(frame) > 2.9 * max(apart)
        run = app.session.simulation.reference["user_position_rad"]
        assert max(plant) == pytest.approx(1e3 * max(run), rel=1e-6), "no peak is lost"
        assert drawn["y"][0] <= min(plant) and drawn["y"][1] >= max(plant)

        app.session.settings.set_fault(0, 0.0)
        app.session.refresh()
