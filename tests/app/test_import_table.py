"""The import table: each column drawn, all mappings in one place, edited there; bad edits are refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from support.comparison_by_hand import comparison as by_hand
from support.on_page import choose, wait_until

from ema_model.errors import InputError
from ema_model.recordings import ColumnMapping, MappedColumn
from emaviz.figures.theme import LIGHT
from emaviz.page.compare import CompareTab
from emaviz.page.compare_columns import Edit, done, drawing, table
from emaviz.session.files import Opened

WIDE = """() => { const table = document.querySelector('.emaviz-map').getBoundingClientRect();
  const panel = document.querySelector('[data-dock-region=right]').getBoundingClientRect();
  return [table.width / panel.width, table.top, table.bottom]; }"""
AXES = """() => [...document.querySelectorAll('.js-plotly-plot')].filter(one => one.checkVisibility())
  .flatMap(one => one.layout.annotations.map(said => said.text))"""


@pytest.mark.parametrize(
    ("numbers", "told"),
    [({}, ""), ({"scale": 2.5, "offset": -0.1}, "× 2.5 − 0.1"), ({"sign": -1, "offset": 0.2}, "+ 0.2")],
)
def test_what_is_done_to_a_column_beside_unit_and_sign_is_told(numbers, told):
    assert done(MappedColumn("current_A", "iq", **numbers)) == told


def test_a_column_is_drawn_with_its_range_and_what_is_missing():
    values = np.concatenate([np.zeros(5000), [7.0], np.full(4999, -2.0)])
    drawn = str(drawing(values))
    points = [tuple(map(float, one.split(","))) for one in drawn.split('points="')[1].split('"')[0].split()]
    assert "−2 … 7" in drawn and min(y for _, y in points) == 1.0, "one sample of ten thousand is seen"
    values[:2500] = np.nan
    assert "25 % missing" in drawing(values) and "always 3" in drawing(np.full(9, 3.0))
    assert "no number" in drawing(np.full(9, np.nan))


def test_names_of_columns_are_no_markup(tmp_path):
    name = "<img onerror=x>'\""
    one = Opened("f.csv", tmp_path / "f.csv", {name: np.arange(9.0)}, ColumnMapping((MappedColumn("current_A", name),)))
    assert "<img" not in table(one, 1, [drawing(np.arange(9.0))], name)


@pytest.fixture
def page(shared_page):
    return shared_page


@pytest.mark.browser
def test_columns_are_drawn_edited_and_used_in_one_table(page, app):
    path = app.comparing.folder.folder / "rig.csv"
    time_s = np.arange(0.0, 0.5, 1e-3)
    columns = {"t [ms]": 1e3 * time_s, "Soll [°]": np.sin(9 * time_s), "Istwinkel Motor [°]": np.sin(9 * time_s)}
    columns |= {"iq [mA]": 900.0 * np.cos(9 * time_s), "channel_7": time_s % 0.01, "T": 20.0 + time_s}
    np.savetxt(path, np.column_stack([*columns.values()]), delimiter=";", header=";".join(columns), comments="")
    page.get_by_role("tab", name="Compare", exact=True).click()
    choose(page, "Data folder", "rig.csv")
    page.get_by_role("button", name="Add this file").click()
    rows = page.locator(".emaviz-map tbody tr")
    rows.nth(5).wait_for()
    assert rows.count() == 6 and rows.locator("svg polyline").count() == 6, "each raw column is drawn"
    wait_until(lambda: page.evaluate(WIDE)[0] > 0.9, 10.0)  # the panel takes its width a moment later
    _, top, bottom = page.evaluate(WIDE)
    assert top < 300.0 and bottom < 900.0 - 68.0, "all of it in sight"

    page.get_by_label("What channel_7 is").select_option("load_torque_Nm")
    page.get_by_label("Unit of channel_7 in the file").select_option("mNm")
    step = app.tab(CompareTab).result.step
    wait_until(lambda: step.mapping.get("load_torque_Nm") is not None and step.mapping.get("load_torque_Nm").unit)
    assert step.mapping.get("load_torque_Nm").converter.to_si(1e3) == pytest.approx(1.0)
    page.get_by_title("Draws channel_7 below").click()
    wait_until(lambda: "<b>channel_7, as it stands in the file</b> [mNm]" in page.evaluate(AXES))
    late = page.get_by_label("channel_7 is late by, ms")
    late.fill("2")
    late.press("Enter")
    wait_until(lambda: step.mapping.get("load_torque_Nm").delay_s == 0.002)
    page.get_by_label("What T is").select_option("load_torque_Nm")  # one column is one signal
    wait_until(lambda: step.mapping.get("load_torque_Nm").column == "T")
    assert dict(step.mapping.unmapped)["channel_7"] == "left aside by you"
    page.get_by_label("What T is").select_option("")
    wait_until(lambda: step.mapping.get("load_torque_Nm") is None)

    number, before = step._table.number, step.mapping
    for edit, why in (
        (Edit(number, 99, "sign"), "no such column"),
        (Edit(number, 4, "sign"), "say first what it is"),
        (Edit(number, 3, "unit", "parsec"), "no such unit"),
        (Edit(number, 3, "signal", "warp"), "no such quantity"),
        (Edit(number, 3, "late", "nan"), "late by how many ms"),
    ):
        with pytest.raises(InputError, match=why):
            step._edit(edit)
    step._edit(Edit(number - 1, 3, "sign"))  # of a file that was shown before
    assert step.mapping == before

    compared = app.tab(CompareTab).panel._compared  # of the file before it, which ends meanwhile
    app.screen.post("compared", lambda: compared(by_hand(("one", "two"))))
    shown = []
    app.screen.post("and then", lambda: shown.append(app.tab(CompareTab).result._comparison))
    wait_until(lambda: shown)
    wait_until(page.locator(".emaviz-map").is_visible, 10.0)
    assert shown[0] is not None and step.mapping == before
    app.screen.post("comparison", app.tab(CompareTab).result.clear)
    app.screen.post("columns", step.redraw)
    figure = app.tab(CompareTab).result._preview.figure
    inks = {one.font.color for one in figure.layout.annotations} | {figure.layout.font.color}
    assert inks == {LIGHT.ink}, "which a dark page draws in its own"
    page.get_by_role("button", name="Use these columns").click()
    wait_until(lambda: app.comparing.opened["rig.csv"].measurement is not None)
    app.comparing.job.stop()
    app.comparing.remove("rig.csv")
    page.get_by_text("Nothing is compared yet").wait_for()
    page.locator(".emaviz-map").wait_for(state="hidden")
