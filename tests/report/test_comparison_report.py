"""The report of a comparison: it opens offline, draws its figures, and takes no text for more than text."""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ema_model.comparison.result import Comparison, SignalError, held_out
from ema_model.comparison.verdict import judge
from ema_model.errors import InputError
from ema_model.recordings.health import Finding, Health
from emaviz.page.compare_result import numbers
from emaviz.recording.writer import written
from emaviz.views.comparison import VIEW
from emaviz.views.report import Figures, export, markup

HOSTILE = '</script><script>window.bad = 1</script><img src="x" onerror="window.bad = 2">&amp;'


@pytest.fixture(scope="module")
def report(comparison: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    export(comparison, path)
    return path


def _own_text(path: Path) -> str:
    """The page without the library that draws."""
    text = path.read_text(encoding="utf-8")
    return re.sub(r"<script>/\*\*.*?</script>", "", text, flags=re.DOTALL)


def test_it_says_what_was_found(report, comparison):
    text = _own_text(report)
    for sentence in comparison.sentences:
        assert sentence.replace("'", "&#x27;") in text
    for region in comparison.worst_regions:
        assert region.sentence.replace("'", "&#x27;") in text
    error = comparison.signals["current_A"]
    assert f">{error.rmse:.3f}<" in text and f">{error.in_floors.text}<" in text
    assert "not adequate" in text and "Data health" in text
    assert "+3.00" in text and "Motor inertia stands at the bound" in text


def test_the_result_shows_and_exports_itself(report, comparison, tmp_path):
    assert len(comparison.figures()) == _own_text(report).count("data-figure=") > 10
    comparison.export(tmp_path / "errors.csv")
    head, *rows = (tmp_path / "errors.csv").read_text().splitlines()
    assert head.startswith("signal,rmse,") and [one.split(",")[0] for one in rows] == list(comparison.signals)
    assert float(rows[0].split(",")[1]) == comparison.signals["current_A"].rmse
    comparison.export(tmp_path / "all.json")
    told = json.loads((tmp_path / "all.json").read_text())
    assert told == json.loads(json.dumps(comparison.to_dict())) and told["worst_regions"][0]["from"] > 0.0
    with pytest.raises(InputError, match="end in one of these"):
        comparison.export(tmp_path / "all.docx")
    with pytest.raises(InputError, match="compute it anew"):  # its series are not told
        Comparison.from_dict(told)


def test_every_link_leads_somewhere(report):
    text = _own_text(report)
    links, anchors = set(re.findall(r'href="#([^"]+)"', text)), set(re.findall(r'id="([^"]+)"', text))
    assert {"against-motor_angle", "recording-1"} <= links <= anchors


def test_nothing_is_calibrated_and_nothing_stands_out(comparison, tmp_path):
    plain = replace(comparison, calibration=None, worst_regions=(), orders=(), explained_by=(), adequate=True)
    export(plain, tmp_path / "r.html")
    text = _own_text(tmp_path / "r.html")
    assert 'id="calibration"' not in text and "No region stands out" in text and ">adequate<" in text


def _hostile(comparison: Comparison) -> Comparison:
    finding = Finding("noise", "warning", HOSTILE)
    recordings = [
        replace(
            one,
            name=HOSTILE,
            health=Health(HOSTILE, (finding,)),
            measurement=replace(one.measurement, name=HOSTILE, notes=(HOSTILE,)),
        )
        for one in comparison.recordings
    ]
    return replace(
        comparison,
        actuator=replace(comparison.actuator, name=HOSTILE),
        recordings=recordings,
        sentences=(HOSTILE,),
        warnings=(HOSTILE,),
        worst_regions=[replace(region, sentence=HOSTILE) for region in comparison.worst_regions],
        explained_by=[replace(one, sentence=HOSTILE) for one in comparison.explained_by],
    )


def test_hostile_names_stay_text(comparison, tmp_path):
    export(_hostile(comparison), tmp_path / "r.html")
    text = _own_text(tmp_path / "r.html")
    assert "window.bad" in text  # it is shown
    assert "<script>window" not in text and "<img" not in text and 'onerror="' not in text


@pytest.mark.parametrize(
    ("place", "why"), [(".", "is a folder"), ("none/r.html", "does not exist"), ("file/r.html", "does not exist")]
)
def test_a_place_that_cannot_be_written_is_told_in_one_line(comparison, tmp_path, place, why):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=why) as error:
        export(comparison, tmp_path / place)
    assert "\n" not in str(error.value) and str(tmp_path) in str(error.value)


def test_a_full_disk_leaves_the_old_report_and_no_draft(comparison, tmp_path, monkeypatch):
    (tmp_path / "r.html").write_text("old")

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        export(comparison, tmp_path / "r.html")
    assert [path.name for path in tmp_path.iterdir()] == ["r.html"]
    assert (tmp_path / "r.html").read_text() == "old"


@pytest.fixture
def tab(browser: Any) -> Iterator[Any]:
    """A page in a browser whose network is blocked; what it asked for and complained of is kept."""
    context = browser.new_context(offline=True, viewport={"width": 1000, "height": 800}, color_scheme="light")
    tab = context.new_page()
    tab.asked, tab.complaints = [], []
    tab.on("request", lambda request: tab.asked.append(request.url))
    tab.on("console", lambda message: tab.complaints.append(message.text))
    tab.on("pageerror", lambda error: tab.complaints.append(str(error)))
    yield tab
    context.close()


def _draw_all(tab: Any) -> None:
    """Opens what is folded and scrolls through, as a reader would."""
    tab.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    for place in tab.locator("[data-figure]").all():
        place.scroll_into_view_if_needed()
        place.locator("svg.main-svg").first.wait_for(timeout=20_000)


@pytest.mark.long
@pytest.mark.browser
def test_all_figures_are_drawn_without_network(report, tab):
    tab.goto(report.as_uri())
    _draw_all(tab)
    assert tab.complaints == []
    assert [url for url in tab.asked if not url.startswith(("file:", "data:", "blob:"))] == []
    figures = tab.locator("[data-figure]").count()
    assert figures >= 20
    inked = tab.evaluate(
        "[...document.querySelectorAll('[data-figure]')].filter((f) =>"
        " f.querySelector('.scatterlayer path, .barlayer path, .polarlayer path')).length"
    )
    assert inked == figures
    titles = set(tab.locator("[data-figure] .ytitle, [data-figure] .xtitle").all_text_contents())
    assert {"Residual torque [mN·m]", "Time [s]", "Motor angle [°]"} <= titles
    assert any("eq" in one and one.endswith("[A]") for one in titles), "the equivalent current, its index set low"
    _nothing_is_covered(tab)


def _nothing_is_covered(tab: Any) -> None:
    overlaps = tab.evaluate(
        """() => {
          const found = [];
          for (const figure of document.querySelectorAll('[data-figure]')) {
            const box = (query) => figure.querySelector(query)?.getBoundingClientRect();
            const plot = box('.bglayer .bg, .plotbg, .xy .plot, .polarlayer .polar .plotbg');
            const legend = box('.infolayer .legend'), title = box('.infolayer .g-gtitle');
            const xtitle = box('.infolayer .xtitle');
            const meet = (a, b) => a && b && a.width && b.width && a.left < b.right - 1 && b.left < a.right - 1
              && a.top < b.bottom - 1 && b.top < a.bottom - 1;
            for (const [name, a, b] of [['legend on plot', legend, plot], ['title on plot', title, plot],
                ['legend on axis', legend, xtitle], ['legend on title', legend, title]])
              if (meet(a, b)) found.push(name + ' in ' + figure.dataset.figure);
            if (title && title.right > figure.getBoundingClientRect().right + 1) found.push('long title');
          }
          return found;
        }"""
    )
    assert overlaps == []
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")  # nothing sticks out


@pytest.mark.long
@pytest.mark.browser
def test_nothing_is_covered_or_cut_on_a_telephone(report, tab):
    tab.set_viewport_size({"width": 390, "height": 844})
    tab.goto(report.as_uri())
    _draw_all(tab)
    _nothing_is_covered(tab)
    wide = "[...document.querySelectorAll('html, .wide')].filter(one => one.scrollWidth > one.clientWidth + 1)"
    assert not tab.evaluate(f"{wide}.map(one => one.textContent.slice(0, 80))"), "every column is seen"


def _until(tab: Any, condition: str) -> None:
    """Waits for it; the page's own policy forbids the browser to wait for a text to be evaluated."""
    for _ in range(100):
        if tab.evaluate(condition):
            return
        tab.wait_for_timeout(100)
    pytest.fail(f"still not: {condition}")


@pytest.mark.long
@pytest.mark.browser
def test_it_follows_light_and_dark_and_prints_whole(report, tab):
    ink = "getComputedStyle(document.querySelector('[data-figure] .gtitle')).fill"
    tab.goto(report.as_uri())
    tab.locator("svg.main-svg").first.wait_for()
    light = tab.evaluate(ink)
    tab.emulate_media(color_scheme="dark")
    _until(tab, f"{ink} !== '{light}'")
    tab.emulate_media(media="print", color_scheme="dark")
    _until(tab, f"{ink} === '{light}'")  # paper is white
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.evaluate("document.querySelectorAll('[data-figure]:not(.js-plotly-plot)').length") == 0


@pytest.mark.long
@pytest.mark.browser
def test_hostile_names_do_nothing_in_a_browser(comparison, tab, tmp_path):
    export(_hostile(comparison), tmp_path / "r.html")
    tab.goto((tmp_path / "r.html").as_uri())
    _draw_all(tab)
    assert tab.evaluate("window.bad") is None and tab.complaints == []
    assert tab.locator("h1 + .lead").inner_text().count("<script>") == 3  # actuator and two recordings


# --- one amount reads alike in the sentence, the terminal, the page, the report and the recording ---------------------

SIZES = {  # of the error and its floor, A: as both are to be read
    (0.2, 0.12): ("0.200", "0.120", "A"),
    (0.2, 0.05): ("0.200", "0.0500", "A"),
    (0.35, 0.3): ("0.350", "0.300", "A"),
    (0.0352, 0.031): ("35.2", "31.0", "mA"),
    (12.3, 0.4): ("12.3", "0.400", "A"),
}


@pytest.mark.parametrize("sizes", SIZES)
def test_an_error_reads_alike_wherever_it_is_told(sizes, comparison):
    rmse, floor = sizes
    size, least, unit = SIZES[sizes]
    error = SignalError(rmse, 3.0 * rmse, 0.1, floor, 0.8 * rmse)
    told = replace(comparison, signals={"current_A": error}, recordings=[])
    sentence = judge(comparison.residuals, comparison.signals | told.signals, None, comparison.actuator).sentences[-1]
    assert f"{size} {unit} rms" in sentence and f"{least} {unit}" in sentence
    row = next(line for line in str(told).splitlines() if line.startswith("  Equivalent current ")).split()
    assert row[3] == size and row[4] == least and row[-1] == unit  # behind its name and what it was before
    page, notebook = numbers(told), told._repr_html_()
    section = next(one for one in VIEW.sections if one.anchor == "errors")
    report = markup(section.pieces(told), Figures())
    for one in (page, notebook, report):
        cells = re.findall(r">([^<>]+)</td>", one)
        at = cells.index("Equivalent current")
        assert cells[at + 2 : at + 4] == [size, least] and unit in cells[at:]
    recording = written("The answer", told.document.blocks)
    assert f" | {size} | {least} | " in recording and f" | {unit} |" in recording
    unseen = replace(comparison.recordings[0], errors=told.signals)
    assert f"{size} {unit} (floor {least} {unit}: " in held_out(unseen)


def test_an_order_reads_alike_in_the_sentence_and_in_the_terminal(comparison):
    told = judge(comparison.residuals, comparison.signals, None, comparison.actuator)
    [sentence] = [one for one in told.sentences if "times a turn" in one]
    order, amount = re.findall(r"repeats (\d+) times a turn with an amplitude of ([^ ]+ [^ ]+)\.", sentence)[0]
    assert f"{order} ({amount})" in str(replace(comparison, orders=told.orders))
