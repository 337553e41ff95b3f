"""An address for each result: it follows what is shown, and opens there; report and recording are links beside it."""

from __future__ import annotations

from http import HTTPStatus
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from support.on_page import wait_until

from emaviz.cli import main as emaviz
from emaviz.page.compare import CompareTab

HINGE = (
    "simulate --effect hinge_moment:stiffness_Nm_rad=1000 --command sine --set amplitude_rad=0.025 "
    "--set frequency_Hz=3 --duration 1 --noise-current 0.2 --sample-rate 2000 --out"
).split()


@pytest.fixture(scope="module")
def hinge(app):
    path = app.comparing.folder.folder / "rig & co" / "hinge.csv"
    path.parent.mkdir()
    assert emaviz([*HINGE, str(path)]) == 0
    return "rig & co/hinge.csv"


@pytest.mark.browser
def test_an_address_opens_its_recording_and_region_and_follows_what_is_chosen(browser, app, hinge):
    asked = f"{app.address}/?view=compare&file=rig~20~26~20co/hinge.csv&region=2"
    with browser.tab() as page:
        page.goto(asked)
        regions = page.get_by_role("button", name="The motor needs")
        regions.nth(1).wait_for(timeout=30_000)
        result = app.tab(CompareTab).result
        wait_until(lambda: result.selected == 1, 30.0)
        assert list(app.comparing.opened) == [hinge]
        regions.first.click()
        page.wait_for_function("location.search.endsWith('&region=1')")
        link = page.get_by_role("link", name="Copy link")
        link.wait_for()
        assert link.get_attribute("href") == "/?view=compare&file=rig~20~26~20co/hinge.csv&region=1"
        box, edge = link.bounding_box(), page.get_by_role("tab", name="Comparison").bounding_box()
        assert abs(box["y"] + box["height"] / 2 - edge["y"] - edge["height"] / 2) < 8.0, "in the line of the tabs"

        assert page.get_by_role("link", name="Report ↗").get_attribute("href") == "/results/compare.html"
        written = []
        for _ in range(2):
            assert "<h1>" in page.request.get(f"{app.address}/results/compare.html").text()
            written.append(sorted(app.comparing.folder.recordings.glob("*compare*")))
        assert written[0] == written[1], "once"
        with page.expect_download() as saved:
            page.get_by_role("link", name=".rrd ↓").click()
        assert saved.value.suggested_filename.endswith("-compare.rrd")

        page.get_by_role("tab", name="Explore", exact=True).click()
        page.wait_for_function("location.search === '?view=explore'")
        page.goto(f"{app.address}/?view=compare&file=gone.csv")
        page.get_by_text("This address cannot be opened").wait_for()
        assert list(app.comparing.opened) == [hinge], "what is open stays"


def status_of(app, name, **headers):
    try:
        with urlopen(Request(f"{app.address}/results/{name}", headers=headers)) as answer:
            return answer.status
    except HTTPError as error:
        return error.code


def test_only_results_are_served_and_to_no_other_page(app, tmp_path):
    (tmp_path / "campaign.json").write_text("{}")
    (tmp_path / "report.html").write_text("secret")
    own = app.comparing.folder.folder / "own"
    own.mkdir()
    (own / "report.html").write_text("of no campaign")
    (own / "link").symlink_to(tmp_path)
    for name in ("track.html", "compare.toml", "own/report.html", "own/link/report.html", f"..{tmp_path}/report.html"):
        assert status_of(app, name) == HTTPStatus.NOT_FOUND, name
    (own / "campaign.json").write_text("{}")
    assert status_of(app, "own/report.html") == HTTPStatus.OK
    assert status_of(app, "own/report.html", **{"Sec-Fetch-Site": "cross-site"}) == HTTPStatus.NOT_FOUND
