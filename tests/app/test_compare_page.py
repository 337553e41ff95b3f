"""Compare in a real browser: a file dropped on the page, its columns, its health, where the model fails."""

from __future__ import annotations

import re
import shutil
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from support.comparison_by_hand import comparison as by_hand
from support.on_page import choose, field, wait_until
from support.two_clocks import write_two_clocks

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.recordings import write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference
from emaviz.page.app import App
from emaviz.page.compare import CompareTab
from emaviz.page.compare_result import View
from emaviz.page.explore import ExploreTab
from emaviz.page.identify import IdentifyTab
from emaviz.page.track import TrackTab

pytestmark = pytest.mark.browser

SHAPES = """() => [...document.querySelectorAll('.js-plotly-plot')].filter(plot => plot.offsetParent).map(plot => ({
  title: plot.layout?.title?.text ?? '', shapes: (plot.layout?.shapes ?? []).length,
  traces: (plot.data ?? []).length }))"""
DROP = """([name, text]) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([text], name, { type: 'text/csv' }));
  const init = { dataTransfer: transfer, bubbles: true, cancelable: true };
  document.querySelector('canvas').dispatchEvent(new DragEvent('drop', init));
}"""


@pytest.fixture(scope="module")
def recording():
    """The Reference Model with cogging, as a rig's sensors would show it."""
    run = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 1.0)
    true = simulate_reference(run, load_actuator(), effects={"cogging_torque": {}})
    return Sensors(current_noise_A=0.2, encoder_bits=12).record(true, seed=1)


@pytest.fixture(scope="module")
def rig_file(recording, tmp_path_factory):
    """The same under names and in units of a rig."""
    columns = {
        "t [ms]": 1e3 * recording.time_s,
        "pos_cmd [deg]": np.rad2deg(recording["command_rad"]),
        "output_angle [deg]": np.rad2deg(recording["user_position_rad"]),
        "motor_angle [deg]": np.rad2deg(recording["motor_position_rad"]),
        "motor_speed [rpm]": recording["motor_speed_rad_s"] * 30.0 / np.pi,
        "iq [mA]": 1e3 * recording["current_A"],
        "channel_7": np.arange(recording.samples) % 7.0,
    }
    path = tmp_path_factory.mktemp("rig") / "rig <b>7.csv"
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    return path


@pytest.fixture(autouse=True)
def signals_in_front(app):
    """As an earlier test may have left a comparison on the right, while a new page is known by its charts."""
    wait_until(lambda: not app.comparing.running)

    def in_front():
        app.session.refresh()
        time.sleep(0.2)
        return app.tab(ExploreTab).right.visible

    wait_until(in_front)


@pytest.fixture
def page(shared_page):
    """The module's one tab."""
    return shared_page


@pytest.fixture
def compare(page, app):
    """The page on its Compare tab, nothing chosen."""
    for name in list(app.comparing.opened):
        app.comparing.remove(name)
    page.get_by_role("tab", name="Compare", exact=True).click()
    page.get_by_role("button", name="Upload a measurement").wait_for()
    wait_until(lambda: not app.comparing.running)
    page.set_default_timeout(60_000)
    return page


def upload(page, path):
    page.locator("input[type=file]").first.set_input_files(str(path))


def figures(page):
    """(title, shapes) of every figure that is seen."""
    return [(one["title"], one["shapes"]) for one in page.evaluate(SHAPES) if one["traces"]]


def number_box(page, label):
    row = page.locator("label", has_text=label).first
    row = row.locator("xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]")
    return float(row.locator("input:not([type=hidden])").first.input_value())


def in_the_table(page, column):
    """What the import table has of a column: quantity, unit, sign, delay."""
    row = page.locator(".emaviz-map tr").filter(has=page.get_by_text(column, exact=True)).first
    fields = row.locator("[data-do=signal], [data-do=unit], [data-do=sign], [data-do=late]")
    return [one.inner_text() if one.get_attribute("data-do") == "sign" else one.input_value() for one in fields.all()]


def test_from_a_file_to_the_region_where_the_model_fails(compare, app, rig_file):
    page = compare
    upload(page, rig_file)
    wait_until(lambda: in_the_table(page, "iq [mA]") == ["current_A", "mA", "+", "0"])
    assert in_the_table(page, "channel_7") == [""]
    wait_until(lambda: len(figures(page)) >= 1)  # the preview
    name = next(iter(app.comparing.opened))
    assert "<" not in name and app.comparing.opened[name].measurement is None

    page.get_by_role("button", name="Use these columns").click()
    page.get_by_text("Data health").wait_for()
    page.get_by_text("rms").first.wait_for()
    page.get_by_text("Compared in").wait_for(timeout=60_000)
    comparison = app.comparing.comparison
    page.get_by_text(comparison.sentences[0]).first.wait_for()
    assert comparison.explained_by[0].variable == "motor_angle"

    region = comparison.worst_regions[0]
    button = page.get_by_role("button", name=region.sentence).first
    button.wait_for()
    wait_until(lambda: len(figures(page)) >= 2)
    before = dict(figures(page))
    button.click()
    wait_until(lambda: all(shapes > before[title] for title, shapes in figures(page)[:2]))

    one = comparison.recordings[0]

    def shown():
        return int(np.argmin(np.abs(one.time_s - number_box(page, "Moment [s]"))))

    wait_until(lambda: region.blocks[shown()])  # the play-head is in the region
    at = shown()
    turned = 0.5 * one.measured["motor_position_rad"][at]
    wait_until(lambda: np.allclose(app.scene._rotor.wxyz, (np.cos(turned), np.sin(turned), 0.0, 0.0), atol=0.02))

    for tab, title in (
        ("Against", "against"),
        ("Orders", "orders"),
        ("Explained by", "explains"),
        ("Calibration", "Calibrated"),
    ):
        page.get_by_role("tab", name=tab, exact=True).click()
        wait_until(lambda title=title: any(title in drawn for drawn, _ in figures(page)))

    page.get_by_role("tab", name="Time", exact=True).click()
    saves, plot = (page.get_by_role("button", name="Save report"), page.locator(".js-plotly-plot:visible").first)
    assert saves.locator("visible=true").bounding_box()["x"] < plot.bounding_box()["x"], "below the answer"
    page.set_viewport_size({"width": 1100, "height": 700})
    chart, verdict = page.locator(".js-plotly-plot:visible").first, page.get_by_text(comparison.sentences[0]).first
    try:  # the first chart stands below the verdict, seen without scrolling
        wait_until(lambda: chart.bounding_box()["y"] + chart.bounding_box()["height"] < 700.0 - 68.0, 10.0)
        assert verdict.bounding_box()["y"] < chart.bounding_box()["y"]
        assert chart.bounding_box()["height"] > 150.0
        evidence = page.get_by_text("What the residual depends on", exact=True)
        assert not evidence.is_visible()
        page.set_viewport_size({"width": 1920, "height": 1080})
        wait_until(evidence.is_visible)  # there is room for it below the regions
        assert evidence.bounding_box()["x"] < chart.bounding_box()["x"]
    finally:
        page.set_viewport_size({"width": 1400, "height": 900})


def test_data_health_tells_a_clock_that_is_late(compare, app, recording, tmp_path):
    page, path = compare, tmp_path / "two clocks.csv"
    write_two_clocks(path, recording, 0.005)
    upload(page, path)
    page.get_by_text("Data health").wait_for()
    page.get_by_text("The motor speed comes").wait_for()
    line = page.get_by_text("The motor speed comes").inner_text()
    assert "a delay between their clocks" in line and "[delay_s=0.005" in line
    low, high = (float(text) for text in re.search(r"90 % interval (\S+) to (\S+) ms", line).groups())
    assert 4.5 < low <= 5.0 <= high < 5.5
    page.get_by_text("others are in order").click()
    page.get_by_text("The file has 2 clocks: brought onto one, linearly between their samples: motor speed.").wait_for()


@pytest.mark.long
def test_a_delay_is_said_and_stays_where_another_thing_is_edited(compare, app, recording, tmp_path):
    page, path = compare, tmp_path / "late clock.csv"
    write_two_clocks(path, recording, 0.005)
    upload(page, path)
    page.get_by_text("The motor speed comes").wait_for()
    name = next(iter(app.comparing.opened))
    page.get_by_role("button", name="Columns…").click()
    late, sign = (
        page.get_by_label(f"{start}motor_speed_rad_s{end}") for start, end in (("", " is late by"), ("Sign of ", ""))
    )
    late.fill("5")
    late.press("Enter")
    wait_until(lambda: in_the_table(page, "motor_speed_rad_s") == ["motor_speed_rad_s", "rad/s", "+", "5"])
    sign.click()
    wait_until(lambda: in_the_table(page, "motor_speed_rad_s")[2:] == ["−", "5"])
    sign.click()
    wait_until(lambda: in_the_table(page, "motor_speed_rad_s")[2:] == ["+", "5"])
    page.get_by_role("button", name="Use these columns").click()
    page.get_by_text("No delay is seen between motor position and motor speed").wait_for(state="attached")
    entry = app.comparing.opened[name].measurement.reading.mapping.get("motor_speed_rad_s")
    assert (entry.delay_s, entry.sign) == (0.005, 1)


@pytest.mark.long
def test_a_column_is_corrected_by_hand(compare, app, rig_file, tmp_path):
    page = compare
    upload(page, shutil.copy(rig_file, tmp_path / "another.csv"))  # a browser tells no change where it is the same
    page.get_by_label("Sign of iq [mA]").click()
    wait_until(lambda: in_the_table(page, "iq [mA]") == ["current_A", "mA", "−", "0"])
    name = next(iter(app.comparing.opened))
    page.get_by_label("What channel_7 is").select_option("temperature_C")
    wait_until(lambda: in_the_table(page, "channel_7")[0] == "temperature_C")
    page.get_by_role("button", name="Use these columns").click()
    wait_until(lambda: app.comparing.opened[name].measurement is not None)
    measurement = app.comparing.opened[name].measurement
    assert measurement["temperature_C"].max() == 6.0
    raw = app.comparing.opened[name].columns["iq [mA]"]
    assert np.allclose(measurement["current_A"], -1e-3 * raw)


@pytest.mark.long
def test_a_header_found_wrongly_is_clicked(compare, app, recording, tmp_path):
    """Below channels' codes, which look as much like a header, stand the names."""
    page = compare
    columns = {"t [ms]": 1e3 * recording.time_s, "Soll <b> [°]": np.rad2deg(recording["command_rad"])}
    columns |= {"Istwinkel Motor [°]": np.rad2deg(recording["motor_position_rad"])}
    columns |= {"Strom iq [mA]": 1e3 * recording["current_A"]}
    header = f"Prüfstand;7\n\nK1;K2;K3;K4\n{';'.join(columns)}"
    path, table = tmp_path / "coded.csv", np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=";", header=header, comments="", fmt="%.10g", encoding="cp1252")
    upload(page, path)
    page.get_by_text("Found: header in line 3, Windows-1252.").wait_for()
    page.get_by_role("button", name="1  Prüfstand;7", exact=True).wait_for()
    name = "uploads/coded.csv"
    assert list(app.comparing.opened[name].columns) == ["K1", "K2", "K3", "K4"]

    choose(page, "Header line", "1")
    page.locator(".emaviz-beside").filter(has_text="line 1: no table begins there").wait_for()
    wait_until(lambda: field(page, "Header line").input_value() == "found by itself")
    page.get_by_role("button", name="4  t [ms];Soll <b> [°]").click()
    page.get_by_text("As said: header in line 4, Windows-1252.").wait_for()
    assert list(app.comparing.opened[name].columns) == list(columns)
    choose(page, "Encoding", "DOS 850")
    page.get_by_text("As said: header in line 4, DOS 850.").wait_for()
    choose(page, "Encoding", "found by itself")
    wait_until(lambda: in_the_table(page, "Strom iq [mA]")[:2] == ["current_A", "mA"])

    page.get_by_role("button", name="Use these columns").click()
    wait_until(lambda: app.comparing.comparison and app.comparing.comparison.recordings[0].name == "coded")
    page.get_by_text("Compared in").wait_for()
    assert np.allclose(app.comparing.opened[name].measurement["current_A"], recording["current_A"], atol=1e-6)


def test_a_bad_file_is_one_line_and_the_app_goes_on(compare, app, tmp_path):
    page = compare
    bad = tmp_path / "bad.csv"
    bad.write_text("time_s,current_A\n0,1\n1e-3,x\n" + "2e-3,1\n" * 200)
    upload(page, bad)
    line = page.locator(".emaviz-beside").filter(has_text="a number is expected")  # stays, beside its toast
    line.wait_for()
    assert line.count() == 1 and "line 3" in line.inner_text()
    assert str(app.comparing.folder.folder) not in line.inner_text()
    assert not app.comparing.opened
    page.get_by_role("tab", name="Explore", exact=True).click()
    drawn = app.session.simulation
    app.session.refresh()
    wait_until(lambda: app.session.simulation is not drawn)


def test_too_large_an_upload_is_refused(compare, app, tmp_path, monkeypatch):
    page = compare
    monkeypatch.setattr(app.shared.uploads, "most_bytes", 100_000)
    large = tmp_path / "large.csv"
    large.write_bytes(b"0" * 700_000)  # in two parts
    before = set(app.comparing.folder.uploads.iterdir())
    upload(page, large)
    beside = page.locator(".emaviz-beside").filter(has_text="over the page's limit of 0.1 MB")
    beside.wait_for()
    page.get_by_role("button", name="Upload a measurement").click(trial=True)  # enabled again
    # viser says so itself, and would take it away after 4 s only
    wait_until(lambda: page.get_by_text("uploaded successfully").count() == 0, seconds=2.5)
    assert set(app.comparing.folder.uploads.iterdir()) == before
    assert beside.is_visible()
    small = tmp_path / "small.csv"
    small.write_bytes(b"no table")
    upload(page, small)
    wait_until(lambda: not beside.is_visible())


@pytest.mark.long
def test_a_file_that_cannot_be_read_is_told_beside_the_button_that_sent_it_as_often_as_it_is_chosen(compare, tmp_path):
    path = tmp_path / "photo.csv"
    path.write_bytes(b"\xff\xd8\xff\xe0" + bytes(range(256)) * 10)
    button = compare.get_by_role("button", name="Upload a measurement")
    beside = button.locator("xpath=..").locator(".emaviz-beside").filter(has_text="photo")
    for _ in range(2):  # an input that kept its value would say nothing of the same file
        with compare.expect_file_chooser() as chooser:
            button.click()
        wait_until(lambda: beside.count() == 0, 20.0)
        chooser.value.set_files(str(path))
        beside.wait_for(timeout=20_000)
    assert compare.get_by_text("The file cannot be read").count(), "and in a toast"
    assert not compare.get_by_text("The comparison has failed").count()


@pytest.mark.long
def test_compare_pressed_while_the_upload_is_still_being_read_is_carried_out(compare, app, recording, tmp_path, reads):
    path = tmp_path / "at_once.csv"
    write_measurement(recording, path)
    before = app.comparing.comparison
    upload(compare, path)
    compare.get_by_text("Reading uploads/at_once.csv …").wait_for()
    compare.get_by_role("button", name="Compare", exact=True).click()
    compare.get_by_text("waiting for uploads/at_once.csv to be read …").wait_for()
    reads.set()
    wait_until(lambda: app.comparing.comparison is not before, 60.0)
    compare.get_by_text("Compared in").wait_for()
    assert compare.locator(".emaviz-beside").count() == 0


def test_a_comparison_that_must_wait_says_for_what_and_can_be_stopped(compare, app, recording):
    start = compare.get_by_role("button", name="Compare", exact=True)
    start.click()
    compare.locator(".emaviz-beside").filter(has_text="no measurement is chosen; upload one").wait_for()
    over = threading.Event()

    def another():
        while not over.wait(0.02):
            yield

    wait_until(lambda: app.session.worker.start(another(), "Taking the session's steps again"))
    write_measurement(recording, app.comparing.folder.uploads / "waits.csv")
    before = app.comparing.comparison
    app.comparing.add("uploads/waits.csv")
    compare.get_by_text("waiting for Taking the session's steps again").wait_for()
    compare.get_by_role("button", name="Stop", exact=True).click()
    compare.get_by_text("Stopped.").wait_for()
    start.click()
    compare.get_by_text("waiting for Taking the session's steps again").wait_for()
    over.set()
    wait_until(lambda: app.comparing.comparison is not before, 60.0)


@pytest.mark.long
def test_a_kind_of_file_that_is_none_of_ours_is_refused(compare, app, tmp_path):
    strange = tmp_path / "run.exe"
    strange.write_bytes(b"MZ" * 100)
    upload(compare, strange)
    compare.get_by_text("run.exe: the page takes measurements").wait_for()
    assert not list(app.comparing.folder.uploads.glob("*.exe"))


def test_a_file_is_dropped_on_the_scene(compare, app):
    rows = "\n".join(f"{i * 1e-3},{np.sin(0.1 * i):.6f}" for i in range(300))
    compare.evaluate(DROP, ["dropped.csv", f"time [s],I_motor [A]\n{rows}\n"])
    wait_until(lambda: "uploads/dropped.csv" in app.comparing.opened)
    wait_until(lambda: in_the_table(compare, "I_motor [A]") == ["current_A", "A", "+", "0"])
    lists = [app.tab(CompareTab).panel._choice, app.tab(IdentifyTab).panel._source]
    wait_until(lambda: all("uploads/dropped.csv" in one.options for one in lists))
    wait_until(lambda: any(one.startswith("uploads (") for one in app.tab(TrackTab).panel._folder.control.options))


def test_the_panel_on_the_right_follows_what_is_done(compare, app, rig_file):
    page = compare
    upload(page, rig_file)
    page.get_by_role("tab", name="Comparison").wait_for()
    assert page.get_by_role("tab", name="Signals").count() == 0
    page.get_by_role("tab", name="Explore", exact=True).click()
    page.get_by_role("button", name="Reset to healthy").click()
    page.get_by_role("tab", name="Signals").wait_for()
    assert page.get_by_role("tab", name="Comparison").count() == 0


@pytest.mark.long
def test_files_of_the_command_line_open_on_compare(browser, recording, tmp_path):
    path = tmp_path / "given.csv"
    write_measurement(recording, path)
    app = App("127.0.0.1", 0, tmp_path / "data", files=[path])
    try:
        assert app.wait_for_first_picture(120.0)
        with browser.tab() as page:
            page.goto(app.address)
            page.get_by_role("button", name="Upload a measurement").wait_for(timeout=60_000)
            page.get_by_text("Compared in").wait_for(timeout=60_000)
            page.get_by_text("Where the model fails", exact=True).wait_for()
    finally:
        app.close()


def test_a_plot_with_nothing_in_it_is_a_line(app):
    bare = replace(by_hand(), orders=())
    plots = app.tab(CompareTab).result._plots
    plots.begin(View(bare))
    spectrum, polar = plots._turn
    assert not spectrum.handle.visible and spectrum.why.visible and "nothing repeats" in spectrum.why.content
    assert polar.handle.visible and not polar.why.visible
    plots.begin(View(by_hand()))
    assert spectrum.handle.visible and not spectrum.why.visible


def test_only_what_was_wrong_goes_away_once_something_else_is_chosen(app):
    line = app.tab(CompareTab).panel._line
    line.say("all measurements are held out", refuses=True)
    line.forget_refusal()
    assert not line._text.content
    line.say("all measurements are held out", refuses=True)
    line.say("Stopped.")
    line.forget_refusal()
    assert "Stopped." in line._text.content
    line.say("")
