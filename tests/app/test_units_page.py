"""Units on the page: what differs in words and figures, the type as an actuator file, a report; and what is refused."""

from __future__ import annotations

import pytest
from support.bench_units import ACTUATOR, FRICTION, write_units
from support.on_page import choose, fill, wait_until

from ema_model.actuator import load_actuator
from emaviz.cli import main
from emaviz.colours import LIMIT
from emaviz.page.fleet import UnitsTab
from emaviz.page.style import STRIP_HEIGHT_PX

pytestmark = pytest.mark.browser


@pytest.fixture
def page(shared_page):
    return shared_page


def parameters_are_seen_whole(page, width, height):
    """In a column of their own, above the playback strip."""

    def seen():
        box = page.locator(".js-plotly-plot").filter(has_text="Parameters of each unit").bounding_box()
        return box and 0.5 * width < box["x"] and box["y"] + box["height"] < height - STRIP_HEIGHT_PX

    page.set_viewport_size({"width": width, "height": height})
    wait_until(seen, 20.0)


def test_units_are_compared(page, app):
    folder = app.comparing.folder
    write_units(folder.folder / "bench")
    whole = folder.folder / "bench" / "left" / "left_slow.csv"
    (whole.parent / "left_begun.csv").write_text("".join(whole.read_text().splitlines(keepends=True)[:51]))
    assert main(["actuator", "new", str(folder.actuators / "mine.toml"), *ACTUATOR]) == 0
    tab = app.tab(UnitsTab)
    page.get_by_role("tab", name="Units", exact=True).first.click()
    page.get_by_text("No units are compared yet").wait_for()
    choose(page, "Units", "bench (3 units)")
    choose(page, "Actuator", "uploaded: actuators/mine.toml")
    fill(page, "Hold out", "*nothing*")
    page.get_by_role("button", name="Compare units").click()
    page.get_by_text("no recording has such a name").wait_for()
    fill(page, "Hold out", "*unseen*")
    page.get_by_role("button", name="Compare units").click()
    page.get_by_text("left_begun.csv: has 50 samples").first.wait_for()
    page.get_by_text("from the rest in motor dynamic friction").first.wait_for()
    page.get_by_text("3 units, 6 recordings fitted, 3 held out").first.wait_for()
    found = tab.comparing.found
    assert [one.unit for one in found.differences] == ["right"]
    own = found.alone["motor.dynamic_friction_Nm"]
    assert all(abs(value - true) < 1e-3 for value, true in zip(own.value, FRICTION.values()))
    parameters, matrix = tab.result._parameters.figure, tab.result._transfer.figure
    marker = parameters.data[0].marker
    assert list(marker.color).count(LIMIT) == list(marker.symbol).count("diamond") == 1, "the unit that differs"
    for width, height in ((1900, 1060), (1400, 900)):
        parameters_are_seen_whole(page, width, height)
    assert matrix.data[0].text[0][2].endswith("A") and "×" in matrix.data[0].text[0][2]
    page.get_by_role("button", name="Save the type as an actuator").click()
    wait_until(lambda: len(folder.actuator_files()) == 2)
    page.get_by_text("Also kept in the data folder: actuators/").wait_for()
    (kept,) = [name for name in folder.actuator_files() if "type" in name]
    assert load_actuator(folder.actuator(kept)).value("motor.dynamic_friction_Nm") == pytest.approx(0.012, rel=0.05)
    page.get_by_role("button", name="Save report").locator("visible=true").click()
    page.get_by_text("Also kept in the data folder: recordings/").locator("visible=true").wait_for()

    page.get_by_role("tab", name="Runs").click()
    fill(page, "Session name", "bench")
    page.get_by_role("button", name="Save session").click()
    wait_until(lambda: folder.session_files() == ["sessions/bench.emaviz"])
    (folder.folder / "bench").rename(folder.folder.parent / "bench")  # as on another computer
    tab.comparing.chosen, tab.comparing.found = "", None
    page.get_by_role("button", name="Load session").click()
    page.get_by_text("Session loaded").wait_for()
    page.get_by_role("tab", name="Units", exact=True).first.click()
    page.get_by_text("from the rest in motor dynamic friction").first.wait_for()
    assert not tab.comparing.job.running and str(tab.comparing.found) == str(found)
    page.get_by_role("button", name="Compare units").click()
    page.get_by_text("no such folder in the data folder").wait_for()


@pytest.mark.long
def test_units_of_several_types_and_one_unit_are_refused(page, app):
    folder = app.comparing.folder.folder
    write_units(folder / "mixed")
    for unit, name in (("left", "a"), ("right", "b")):
        (folder / "mixed" / unit / f"{unit}_slow.toml").write_text(f'actuator = "{name}.toml"\n')
    (folder / "alone").mkdir()
    (folder / "mixed" / "middle").rename(folder / "alone" / "middle")
    page.get_by_role("tab", name="Units", exact=True).first.click()
    choose(page, "Units", "mixed (2 units)")
    page.get_by_role("button", name="Compare units").click()
    page.get_by_text("units that are compared are of one type").wait_for()
    choose(page, "Units", "alone (1 unit)")
    page.get_by_role("button", name="Compare units").click()
    page.get_by_text("one unit only (middle)").wait_for()
