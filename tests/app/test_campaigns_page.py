"""Campaigns on the page: found, told, and a row opened as a run with its recording."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from support.cheap_plans import written
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.campaign import load_plan
from ema_model.campaign.kinds import KINDS
from ema_model.campaign.rows import common
from ema_model.campaign.store import Campaign, Store, header_of
from ema_model.campaign.task import inputs_of
from ema_model.errors import InputError
from emaviz.page.campaigns import figures, label, progress_bars, tables
from emaviz.recording import read
from emaviz.session import session_file
from emaviz.session.campaigns import REPORT, Campaigns
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.session_file import Part
from emaviz.views.campaign import case_in_words

GROUPS = """
[groups.worn]
CHEAP
faults = { k1 = 0.3 }
noise_A = 0.2
seeds = [4]

[groups.shown]
does = "compare"
runs = "short"
seeds = [1]
"""


def made(folder, at):
    """A campaign of two kinds, computed here without a worker's settings."""
    plan = load_plan(written(at, GROUPS))
    store = Store.writing(folder, header_of("A worn one", "", plan.tasks), plan.text, plan.tasks)
    for task in plan.tasks:
        kind = KINDS[task.kind]
        settings = kind.settings(**task.settings)
        store.append(task.kind, [common(task) | kind.run(inputs_of(task), settings, task.seed)])
    store.close()
    return Store(folder)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = DataFolder(tmp_path_factory.mktemp("data"))
    (folder.folder / "campaigns").mkdir()
    made(folder.folder / "campaigns" / "first", tmp_path_factory.mktemp("plan"))
    return folder


@pytest.fixture
def session(data):
    session = Session(load_actuator(), data.recordings)
    yield session
    session.close()


def test_campaigns_are_found_below_the_data_folder_and_where_they_are_named(session, data, tmp_path):
    assert Campaigns(session, data).names() == ["campaigns/first"]
    plan = load_plan(written(tmp_path, GROUPS))
    Store.writing(tmp_path / "other", header_of("Other", "", plan.tasks), plan.text, plan.tasks).close()
    both = Campaigns(session, data, [tmp_path / "other"])
    assert both.names() == [str(tmp_path / "other"), "campaigns/first"]
    assert both.store(str(tmp_path / "other")).header.title == "Other"
    with pytest.raises(InputError, match="no such campaign"):
        both.store("../../etc")
    with pytest.raises(InputError, match="is no campaign's folder"):
        Campaigns(session, data, [tmp_path])


def test_a_link_that_leads_outside_is_no_campaign(session, data, tmp_path):
    plan = load_plan(written(tmp_path, GROUPS))
    Store.writing(tmp_path / "secret", header_of("Secret", "", plan.tasks), plan.text, plan.tasks).close()
    link = data.folder / "campaigns" / "link"
    link.symlink_to(tmp_path / "secret")
    try:
        assert Campaigns(session, data).names() == ["campaigns/first"]
    finally:
        link.unlink()


@pytest.mark.parametrize("kind", ["identify", "compare"])
def test_a_row_opens_as_a_run_with_its_recording(session, data, kind):
    campaigns = Campaigns(session, data)
    (row,) = campaigns.store("campaigns/first").table(kind).to_pylist()
    done, told = threading.Event(), []
    campaigns.opened.connect(lambda *opened: (told.append(opened), done.set()))
    session.events.told.connect(lambda *line: (told.append(line), done.set()))
    assert campaigns.open_row("campaigns/first", row["name"])
    assert done.wait(120.0)
    ((path, run),) = told
    assert path.parent == data.recordings and run.samples == 501
    recording = read(path)
    assert recording.complete
    if kind == "identify":
        found = recording.properties["found"]["do"]
        assert found["k"] == pytest.approx([row[name] for name in ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "k8")])
    assert "current_A" in recording.signals["reference" if kind == "identify" else "measurement"]
    wait_until(lambda: not session.worker.busy)
    with pytest.raises(InputError, match="no such row"):
        campaigns.open_row("campaigns/first", "nothing")


@pytest.mark.parametrize(
    ("group", "case", "told"),
    [
        ("cogging_torque", "cogging_torque 0.024", "cogging torque 24.0 mN·m"),
        ("load_dependent_friction", "load_dependent_friction 0.15", "load-dependent friction 0.150"),
        ("viscous_friction", "motor.viscous_friction_Nms_rad+0.00015", "motor viscous friction +0.000150 N·m·s/rad"),
        ("mine", "step · hinge_moment 500", "mine · step · hinge moment 500 N·m/rad"),
        ("worn", "k1=0.3", "worn · k1=0.3"),
        ("nothing_hidden_step", "", "nothing hidden step"),
    ],
)
def test_a_plans_cases_are_said_in_words_and_units(group, case, told):
    assert case_in_words(group, case) == told


def test_what_the_list_says_of_a_row(data):
    store = Store(data.folder / "campaigns" / "first")
    (row,) = store.table("identify").to_pylist()
    assert label(row, 1) == f"1 · Err {row['error_wrapped_percent']:.2f} % · k1=0.3 · seed 4"
    assert label(row | {"error": "broken"}, 2) == "2 · error · k1=0.3 · seed 4"
    (row,) = store.table("compare").to_pylist()
    by_speed = {"adequate": False, "variable": "motor_speed", "modulator": "sign_speed"}
    assert label(row | by_speed, 1) == "1 · Motor speed × direction · seed 1"
    assert label(row | by_speed | {"variable": None}, 1) == "1 · not adequate · seed 1"
    shown = tables(store)
    assert "A worn one" in progress_bars(store) and "1 of 1" in progress_bars(store)
    assert [figure.layout.title.text for figure, _ in figures(store)] == [
        "<b>Error of the identified k</b>",
        "<b>What explains the residual first</b>",
    ]
    assert "<td>worn</td>" in shown and "Comparison" in shown


@pytest.mark.long
@pytest.mark.browser
def test_a_row_is_chosen_and_opened_on_the_page(watched, app, tmp_path):
    page = watched
    made(app.session.folder.parent / "campaigns" / "<b>here", tmp_path)
    page.get_by_role("tab", name="Runs").click()
    page.get_by_text("Campaigns", exact=True).click()
    page.get_by_role("button", name="Look for campaigns again").click()
    page.get_by_text("2 of 2 tasks have a row").wait_for()
    before = set(app.session.folder.glob("*.rrd"))
    page.get_by_role("button", name="Open as a run").click()
    wait_until(lambda: set(app.session.folder.glob("*.rrd")) - before, 120.0)
    frame = page.frame_locator("iframe.emaviz-rerun")
    frame.locator("#the_canvas_id").wait_for(timeout=120_000, state="attached")
    page.get_by_role("tab", name="Campaign", exact=True).click()
    page.get_by_text("A worn one").wait_for()


def through_a_file(data, saved, name):
    """What is saved as a session's file gives it back."""
    back = []
    path = session_file.free_path(data, name)
    session_file.write_session(path, {"campaign": Part(lambda: saved, lambda *_: None)}, data, [])
    session_file.read_session(path, {"campaign": Part(dict, lambda given, _: back.append(given))}, data)
    return back[0]


def drawn(store):
    """All that the page draws of a campaign."""
    rows = [store.table(kind, how=True).to_pylist() for kind in store.header.kinds.values()]
    labels = [label(row, number) for one in rows for number, row in enumerate(one)]
    pictures = [figure.to_json() for figure, _ in figures(store)]
    return [str(progress_bars(store)), str(tables(store)), pictures, labels, Campaign(store).document.text, rows]


def test_a_session_brings_its_campaign_to_another_folder(session, data, tmp_path, computed):
    there = DataFolder(tmp_path / "there")
    other = Campaigns(Session(load_actuator(), there.recordings), there)
    campaigns = Campaigns(session, data)
    before = drawn(campaigns.store("campaigns/first"))
    Campaign(campaigns.store("campaigns/first")).export(data.folder / "campaigns" / "first" / REPORT)
    assert campaigns.has_report("campaigns/first")
    saved = through_a_file(there, campaigns.saved("campaigns/first"), "campaign")
    computed.clear()
    assert other.restore(saved) == "campaigns/first" and other.names() == ["campaigns/first"]
    assert other.has_report("campaigns/first") and not (there.folder / "campaigns" / "first" / REPORT).exists()
    report = other.report(f"campaigns/first/{REPORT}")
    assert report is not None and report.read_text().startswith("<!"), "written when it is asked for"
    assert drawn(other.store("campaigns/first")) == before and not computed
    assert other.restore(saved) == "campaigns/first" and len(other.names()) == 1, "it is there"
    assert campaigns.restore(saved) == "campaigns/first" and len(campaigns.names()) == 1, "where it was saved, too"
    (there.folder / "campaigns" / "first" / "plan.toml").write_text("another")
    assert other.restore(saved) == "campaigns/first (2)" and drawn(other.store("campaigns/first (2)")) == before
    row = other.store("campaigns/first").table("identify").to_pylist()[0]
    assert other.store("campaigns/first").task(row).actuator, "a row can be computed again"
    assert campaigns.saved("nothing") is None and campaigns.saved("../../etc") is None


@pytest.mark.parametrize(
    "damage",
    [
        lambda one: one.update({"name": 7}),
        lambda one: one.update({"campaign": 7}),
        lambda one: one["campaign"].update({"class": "Path"}),
        lambda one: one["campaign"]["fields"]["rows"][0].__setitem__(0, "../../evil"),
        lambda one: one["campaign"]["fields"]["rows"][0].__setitem__(1, np.frombuffer(b"[[[", np.uint8)),
        lambda one: one["campaign"]["fields"]["rows"][0].__setitem__(1, np.frombuffer(b'[{"name": [7]}]', np.uint8)),
        lambda one: one["campaign"]["fields"]["rows"][0].__setitem__(1, np.zeros(3)),
        lambda one: one["campaign"]["fields"]["actuators"].append(["../../evil", "x"]),
        lambda one: one["campaign"]["fields"]["header"]["fields"].update({"schema": 99}),
    ],
)
def test_a_damaged_campaign_of_a_session_is_refused_in_one_line_and_leaves_nothing(session, data, tmp_path, damage):
    there = DataFolder(tmp_path / "there")
    other = Campaigns(session, there)
    saved = through_a_file(there, Campaigns(session, data).saved("campaigns/first"), "campaign")
    damage(saved)
    with pytest.raises(InputError) as told:
        other.restore(saved)
    assert "\n" not in str(told.value) and not other.names()
    assert not [one for one in there.folder.rglob("*") if one.is_file() and one.suffix != ".emaviz"]
    assert not (tmp_path / "evil.toml").exists()


def test_a_name_of_a_session_that_leads_outside_stays_inside(session, data, tmp_path):
    there = DataFolder(tmp_path / "there")
    saved = Campaigns(session, data).saved("campaigns/first")
    for name in ("../../evil", "/etc/passwd", "a/../..", "\0"):
        told = Campaigns(session, there).restore({**saved, "name": name})
        assert (there.folder / told).resolve().is_relative_to(there.folder)
    assert not (tmp_path / "evil").exists()
