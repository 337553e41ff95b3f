"""The job bar, on every tab: what runs, its Stop, the line of what waits; and rows of a campaign as they come."""

from __future__ import annotations

import re
import threading

import pytest
from support.cheap_plans import cheap
from support.flights import flights
from support.known_flights import FOLLOWING, known, write_flights
from support.on_page import choose, fill, wait_until

from ema_model.campaign.store import Store
from emaviz.page.track import TrackTab
from emaviz.session.jobs import Job

pytestmark = pytest.mark.browser
COUNT = 10
LIFE = flights([0.05 * i for i in range(COUNT)])


@pytest.fixture
def page(shared_page):
    return shared_page


def test_what_runs_is_told_on_every_tab_and_what_comes_waits_in_line(page, app, monkeypatch):
    """Track runs while somebody is at Library, which waits; flights are drawn as they come; both Stops answer."""
    let_go, plain = threading.Semaphore(0), known(LIFE, [])

    def slowly(*asked, **told):
        let_go.acquire(timeout=60.0)
        return plain(*asked, **told)

    monkeypatch.setattr(f"{FOLLOWING}.identified", slowly)
    write_flights(app.comparing.folder.folder / "unit", COUNT)
    box, jobs = page.locator("[data-floating-window]:has(.emaviz-jobs)"), app.session.worker.jobs
    page.get_by_role("tab", name="Track", exact=True).click()
    choose(page, "Flights", f"unit ({COUNT})")
    page.get_by_role("button", name="Track", exact=True).click()
    page.get_by_text("The first are drawn as soon as they are identified.").locator("visible=true").wait_for()
    let_go.release(3)
    page.get_by_text(f"3 of {COUNT} flights are identified. A trend is looked for from 8 on.").wait_for()
    drawn = app.tab(TrackTab).result._so_far.figure
    assert [len(one.x) for one in drawn.data] == [3] * 7 and drawn.layout.yaxis.title.text == "k [-]"

    page.get_by_role("tab", name="Library", exact=True).click()
    box.get_by_text("Identifying flights").wait_for()
    box.get_by_text(f"Flight 4 of {COUNT}").wait_for()
    box.get_by_text(re.compile(r"\d+ s, about \d+ s left|\d+ s")).first.wait_for()
    page.get_by_role("button", name="Simulate all for their thumbnails").click()
    page.locator(".emaviz-beside").filter(has_text="In line: begins after Identifying flights").wait_for()
    assert [one.title for one in jobs.waiting] == ["Simulate all for their thumbnails"]
    box.get_by_role("button", name="Simulate all for their thumbnails").click()  # out of the line
    wait_until(lambda: not jobs.waiting, 10.0)
    page.locator(".emaviz-beside").wait_for(state="detached")
    assert jobs.running is not None and jobs.running.job is app.tab(TrackTab).following.job

    let_go.release(5)
    wait_until(lambda: app.tab(TrackTab).following.last is not None, 20.0)  # eight are enough to look
    box.get_by_role("button", name="Stop this run").click()
    box.get_by_text("stopping …").wait_for()  # else all flights may be done before it is heard
    let_go.release(20)
    box.get_by_text("Stopped: identifying flights").wait_for()
    box.get_by_text("Show").click()
    page.wait_for_function("location.search.includes('view=track')")
    page.get_by_text("After flight_0").first.wait_for()


def test_what_waits_begins_by_itself_with_what_is_chosen_then(page, app):
    """And says what is refused then, beside its button."""
    go_on, job = threading.Event(), Job(app.session.worker)

    def work(run):
        while not go_on.wait(0.02):
            run("holding")

    assert job.begin("Holding", work)
    page.get_by_role("tab", name="Identify", exact=True).click()
    fill(page, "Iterations", 2)
    fill(page, "Population", 8)
    page.get_by_role("button", name="Identify", exact=True).first.click()
    page.locator(".emaviz-beside").filter(has_text="In line: begins after Holding").wait_for()
    fill(page, "Iterations", 3)
    wait_until(lambda: app.session.settings.iterations == 3, 10.0)
    app.session.worker.jobs.running.job.stop()
    wait_until(lambda: app.session.identifying.race is not None, 120.0)
    assert app.session.identifying.race.settings.iterations == 3 and not app.session.worker.jobs.waiting
    page.locator(".emaviz-beside").wait_for(state="detached")
    page.get_by_role("link", name="Report ↗").wait_for()
    address = f"{app.address}/results/identify.html"
    assert "<html" in page.request.get(address).text()
    go_on.set()


@pytest.mark.long
def test_a_campaign_begins_on_the_page_and_its_rows_are_drawn_as_they_come(page, app, tmp_path):
    plans = app.comparing.folder.folder / "plans"
    plans.mkdir()
    cheap(plans, 4, "mine.toml")
    page.get_by_role("tab", name="Runs", exact=True).click()
    page.get_by_text("Compute a campaign", exact=True).click()
    seen = []
    app.campaigns.grown.connect(lambda name: seen.append(Store(plans.parent / name).progress()["cheap"]["rows"]))
    choose(page, "Plan", "plans/mine.toml")
    page.get_by_text("mine: 4 tasks. About").wait_for()
    fill(page, "Folder", "../out")
    page.get_by_role("button", name="Compute", exact=True).click()
    page.locator(".emaviz-beside").filter(has_text="a campaign's name is of letters").first.wait_for()
    fill(page, "Folder", "mine")
    page.get_by_role("button", name="Compute", exact=True).click()
    page.locator(".emaviz-campaign").get_by_text("4 of 4").wait_for(timeout=120_000)
    assert seen[0] < 4 and seen[-1] == 4, "it is told before its end"
    page.get_by_text("Error of the identified k").first.wait_for()
    wait_until(lambda: not app.session.worker.busy)
    page.get_by_role("link", name="Report ↗").wait_for()
    assert "<html" in page.request.get(f"{app.address}/results/campaigns/mine/report.html").text()
    page.wait_for_function("location.search.includes('campaign=campaigns/mine')")
