"""Actuators that the three-phase Reference Model is not of: explored with the Monitor Model, or told why not."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.faults import HEALTHY, vector
from ema_model.simulation import pack, plant
from ema_model.simulation.pack import library_stack, own_stack, stack_at_hand
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference
from emaviz.page.app import App
from emaviz.page.explore import ExploreTab
from emaviz.session.explore import Session
from emaviz.session.files import shipped_actuators

SERVO, DRIVE = "XL330 on a pendulum", "ODrive motor"


def actuator(name):
    return load_actuator(shipped_actuators()[name])


def test_the_thesis_actuator_is_its_reference_model():
    ours, k = load_actuator(), vector({"k1": 0.3})
    assert plant.note(ours) == "" and plant.can_be_explored(ours)
    run = Run(duration_s=0.05)
    shown = plant.simulate(run, ours, k, {}, start_rad=0.001)
    assert np.array_equal(shown["current_A"], simulate_reference(run, ours, k, start_rad=0.001)["current_A"])


@pytest.mark.long
def test_a_servo_is_explored_as_its_monitor_model():
    servo, k = actuator(SERVO), vector({"k1": 0.8})
    run = Run(duration_s=0.2)
    shown = plant.simulate(run, servo, k, {}, start_rad=0.1, start_speed_rad_s=3.0)
    assert np.array_equal(shown["current_A"], simulate_monitor(run, servo, k, start_rad=0.1)["current_A"])
    assert "phase_a_current_A" not in shown and "no three-phase reference model" in plant.note(servo)
    assert plant.to_identify(run, servo, k, "filtered", {}).sample_period_s == pytest.approx(1e-4)


def test_a_drive_without_a_controller_is_refused_in_one_line():
    drive = actuator(DRIVE)
    assert not plant.can_be_explored(drive)
    for act in (lambda: plant.simulate(Run(), drive, HEALTHY, {}),
                lambda: plant.to_identify(Run(), drive, HEALTHY, "raw", {})):  # fmt: skip
        with pytest.raises(InputError, match="cannot be explored") as told:
            act()
        assert "\n" not in str(told.value)


@pytest.mark.long
@pytest.mark.parametrize("name", [SERVO, DRIVE])
def test_a_session_of_either_starts_and_tells_no_failure(name, tmp_path):
    session = Session(actuator(name), tmp_path)
    told, shown, ended = [], [], threading.Event()
    session.events.told.connect(lambda title, text: told.append(f"{title}: {text}"))
    session.events.simulated.connect(shown.append)
    session.identifying.job.ended.connect(lambda _: ended.set())
    session.start()
    try:
        assert session.ready.wait(120.0)
        session.settings.set_fault(0, 0.5)
        session.settings.set("iterations", 3)
        session.settings.set("population", 8)
        session.refresh()
        if name == SERVO:
            wait_until(lambda: len(shown) > 1)
        assert told == []
        assert session.identify() and ended.wait(60.0)
        wait_until(lambda: not session.worker.busy)
        if name == SERVO:
            assert told == [] and session.identifying.answer is not None
        else:
            wait_until(lambda: told)
            assert len(told) == 1 and "cannot be explored" in told[0] and not shown
    finally:
        session.close()


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.parametrize("name", [SERVO, DRIVE])
def test_the_page_says_what_it_cannot_show(browser, tmp_path, name, capfd):
    app = App("127.0.0.1", 0, tmp_path, str(shipped_actuators()[name]))
    try:
        assert app.wait_for_first_picture(120.0)
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(app.address)
        page.get_by_text(plant.note(app.session.actuator)[:60]).wait_for(timeout=60_000)
        if name == SERVO:
            app.tab(ExploreTab).panel.set_faults(replace_first(HEALTHY, 0.8))
            before = app.session.simulation
            wait_until(lambda: app.session.simulation is not before)
        else:
            app.tab(ExploreTab).panel.set_faults(replace_first(HEALTHY, 0.8))
        for tab in ("Identify", "Compare", "Runs", "Explore"):
            page.get_by_role("tab", name=tab, exact=True).click()
        page.wait_for_timeout(500)
        page.close()
    finally:
        app.close()
    assert "Traceback" not in capfd.readouterr().err


def replace_first(k, value):
    changed = k.copy()
    changed[0] = value
    return changed


@pytest.mark.parametrize(("name", "kernel"), [(None, "run"), pytest.param(SERVO, "traces", marks=pytest.mark.long)])
def test_a_start_compiles_the_plants_own_kernels_and_behind_them_the_librarys(tmp_path, monkeypatch, name, kernel):
    asked = []
    monkeypatch.setattr(pack, "compile_ahead", lambda kernels, urgent=True: asked.append((list(kernels), urgent)))
    ours = load_actuator() if name is None else actuator(name)
    session = Session(ours, tmp_path)
    session.start()
    try:
        wait_until(lambda: asked, 120.0)
    finally:
        session.close()
    library = library_stack(ours)
    assert asked == [([(library, kernel), (library, "traces")], False)]
    assert stack_at_hand(ours, [], "reduced", kernel) is own_stack(ours)
    assert plant.is_compiled(ours, {}) and not plant.is_compiled(ours, {"cogging_torque_3": {}})
