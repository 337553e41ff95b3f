"""An actuator described on the page: its file says the same as the command line's, and Compare takes it."""

from __future__ import annotations

import pytest
from support.on_page import choose, field, wait_until

from ema_model.actuator import load_actuator
from ema_model.actuator.parameters import says_drive
from ema_model.actuator.reference import kinds_of_actuators, parameter_rows
from ema_model.errors import InputError
from ema_model.quantities import Axes
from emaviz.cli import main
from emaviz.session.data_folder import DataFolder
from emaviz.session.files import UPLOADED, Description

ANSWERS = {
    "transmission.gear_ratio": "500:1",
    "motor.inertia_kgm2": "1e-4 ± 5%",
    "motor.torque_constant_Nm_A": "0.06",
    "motor.static_friction_Nm": "0.02 fixed",
}


def test_it_writes_what_the_command_line_writes(tmp_path):
    folder = DataFolder(tmp_path / "data")
    name, doubts = Description("Rig", controller="cascade", drive="hysteresis", answers=ANSWERS).save(folder)
    made = folder.actuator(name.removeprefix(UPLOADED))
    options = [f"--set={path}={text}" for path, text in ANSWERS.items() if "gear" not in path]
    asked = ["--name=Rig", "--gear=500:1", "--controller=cascade", "--drive=hysteresis"]
    assert main(["actuator", "new", str(tmp_path / "rig.toml"), *asked, *options]) == 0
    assert made.read_text() == (tmp_path / "rig.toml").read_text() and "# Each parameter" in made.read_text()
    assert any("is still a guess" in line for line in doubts) and not any("inertia" in line for line in doubts)
    again, _ = Description("Rig").save(folder)
    assert again == f"{UPLOADED}actuators/Rig-2.toml"


@pytest.mark.parametrize(("controller", "drive"), kinds_of_actuators())
def test_every_kind_is_asked_what_its_file_must_say(controller, drive, tmp_path):
    one = Description(controller=controller, drive=drive)
    kind = f"{controller} + {drive}" if says_drive(controller, drive) else controller
    rows = [row for row in parameter_rows() if kind in row.kinds]
    needed = {row.path for row in rows if row.default == "needed" or kind in row.default}
    assert needed and needed <= {question.path for question in one.questions}
    name, _ = one.save(DataFolder(tmp_path / "data"))
    actuator = load_actuator(tmp_path / "data" / name.removeprefix(UPLOADED))
    assert actuator.controller.kind == controller and actuator.name == "New actuator"


def test_step_and_filter_fit_the_recordings_that_are_open(tmp_path):
    folder = DataFolder(tmp_path / "data")
    for name, controller in (("servo", "position"), ("rig", "unknown")):
        asked = [f"--name={name}", f"--controller={controller}", "--sample-rate=50"]
        assert main(["actuator", "new", str(tmp_path / f"{name}.toml"), *asked]) == 0
        Description(name, controller=controller, sample_rate_Hz=50.0).save(folder)
        made = (tmp_path / "data" / "actuators" / f"{name}.toml").read_text()
        assert made == (tmp_path / f"{name}.toml").read_text()
    assert load_actuator(tmp_path / "servo.toml").step_s == 5e-4
    assert load_actuator(tmp_path / "rig.toml").filter_s == 0.06


def test_a_screw_is_said_by_its_lead(tmp_path):
    one = Description(axes=Axes(user="linear"), answers={"transmission.gear_ratio": "10 mm"})
    assert next(one.questions).unit == "m/rad"
    name, _ = one.save(DataFolder(tmp_path / "data"))
    actuator = load_actuator(tmp_path / "data" / name.removeprefix(UPLOADED))
    assert actuator.transmission.gear_ratio == pytest.approx(0.01 / 6.283185307)


@pytest.mark.parametrize(
    ("path", "text", "line"),
    [
        ("motor.inertia_kgm2", "heavy", "Motor inertia: write a number, or value±tolerance"),
        ("motor.inertia_kgm2", "-1", "inertia_kgm2"),
        ("transmission.gear_ratio", "0:1", "Transmission gear ratio: write a number"),
    ],
)
def test_an_answer_that_is_none_is_one_line_and_writes_nothing(path, text, line, tmp_path):
    folder = DataFolder(tmp_path / "data")
    with pytest.raises(InputError, match=line) as caught:
        Description(answers={path: text}).save(folder)
    assert "\n" not in str(caught.value) and not folder.actuator_files()


@pytest.mark.long
@pytest.mark.browser
def test_a_form_makes_an_actuator_and_compare_takes_it(page, app):
    comparing = app.comparing
    page.set_default_timeout(60_000)
    page.get_by_role("tab", name="Compare", exact=True).click()
    page.get_by_text("New actuator", exact=True).click()
    field(page, "Name").fill("Rig <b>2</b>")
    choose(page, "User is", "linear")
    choose(page, "Controller", "position")
    page.get_by_text("a position loop alone, as servos have it").wait_for()
    page.get_by_text("of all that moves, as the motor feels it. Left empty: guess").wait_for()
    field(page, "Transmission gear ratio [m/rad]").fill("10 mm")
    field(page, "Motor inertia [kg·m²]").fill("heavy")
    make = page.get_by_role("button", name="Make this actuator")
    make.click()
    page.get_by_text("Motor inertia: write a number").wait_for()
    assert not comparing.folder.actuator_files()
    field(page, "Motor inertia [kg·m²]").fill("2e-4 ± 5%")
    make.click()
    page.get_by_text("is made, and chosen above").wait_for()
    wait_until(lambda: comparing.actuator.name == "Rig <b>2</b>")
    assert field(page, "Actuator").input_value() == comparing.actuator_name
    made = comparing.actuator
    assert made.axes == Axes(user="linear") and made.controller.kind == "position"
    assert made.motor.inertia_kgm2 == 2e-4 and made.tolerances["motor.inertia_kgm2"].sigma == pytest.approx(1e-5)
    page.get_by_text("controller.gain_1_m = 1000 is still a guess").wait_for()
    comparing.choose_actuator(app.session.actuator.name)
