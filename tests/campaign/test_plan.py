"""Plans: products of axes, what is drawn, lists of recordings; and one clear line for what is wrong in one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.cheap_plans import cheap, written
from support.hidden_effects import ACTUATOR, plant
from support.hidden_effects import recorded as by_hand

from ema_model.campaign import load_plan, shipped_plans
from ema_model.campaign.kinds import KINDS
from ema_model.campaign.task import effects_of, from_json, inputs_of, text_hash
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError


def test_a_group_is_the_product_of_its_axes(tmp_path):
    plan = load_plan(
        written(
            tmp_path,
            """[groups.all]
CHEAP
faults = [{ k1 = 0.25 }, { grid = { k2 = [0.1, 0.2], k8 = [0.4, 0.6] } }, {}]
noise_A = [0.0, 0.45]
load_torque_Nm = [0.0, 10.0]
fitness = ["filtered", "raw"]
seeds = { from = 3, count = 5 }
""",
        )
    )
    assert len(plan.tasks) == 6 * 2 * 2 * 2 * 5
    assert len({task.name for task in plan.tasks}) == len(plan.tasks)
    cases = {task.case for task in plan.tasks}
    assert len(cases) == 6 * 2 * 2 * 2 and "k2=0.1 k8=0.6 · load 10 N·m · noise 0.45 A · fitness raw" in cases
    assert {task.seed for task in plan.tasks} == set(range(3, 8))


def test_a_task_is_its_json_and_its_name_follows_from_all_of_it(tmp_path):
    first, second = load_plan(cheap(tmp_path, 2)).tasks
    assert from_json(first.as_json(), {text_hash(first.actuator): first.actuator}) == first
    assert first.actuator not in first.as_json()
    others = [
        second,
        replace(first, seed=7),
        replace(first, actuator=first.actuator + "\n"),
        replace(first, settings={**first.settings, "population": 5}),
        replace(first, simulated=replace(first.simulated, noise_A=0.46)),
    ]
    assert len({first.name, *(other.name for other in others)}) == 6
    assert load_plan(cheap(tmp_path, 2)).tasks[0].name == first.name


def test_a_plan_written_out_is_the_same_plan(tmp_path):
    for name, path in shipped_plans().items():
        if name.startswith("field_"):  # whose recordings are not shipped: test_data_sets.py
            continue
        plan = load_plan(path)
        copy = tmp_path / f"{name}.toml"
        copy.write_text(plan.text, encoding="utf-8")
        assert load_plan(copy).tasks == plan.tasks


def test_a_plant_is_the_one_that_the_studies_draw():
    """Base parameters, noise and what is hidden follow from the seed alone, recording by recording."""
    plan = load_plan("discovery")
    task = next(task for task in plan.tasks if task.group == "named" and task.case.startswith("cogging_torque/clear"))
    assert task.simulated is not None
    assert task.simulated.values == {path: plant(task.seed).value(path) for path in task.simulated.values}
    phase = float(np.random.default_rng(task.seed).uniform(-3.0, 3.0))
    effects = {"cogging_torque": {"amplitude_Nm": 0.012, "order": 12.0, "phase_rad": phase}}
    commands = [(one.command, one.settings, one.duration_s) for one in task.simulated.runs]
    short = [(name, settings, 0.05) for name, settings, _ in commands]
    expected = by_hand(task.seed, commands=short, effects=effects)
    runs = tuple(replace(one, duration_s=0.05) for one in task.simulated.runs)
    found = inputs_of(replace(task, simulated=replace(task.simulated, runs=runs, holdout=())))
    for one, other in zip(found.fitted, expected):
        for name in other.signals:
            np.testing.assert_allclose(one[name], other[name], rtol=1e-9, atol=1e-9)


def test_what_is_drawn_follows_from_the_seed(tmp_path):
    plan = load_plan(
        written(
            tmp_path,
            """[groups.drawn]
CHEAP
faults = [{ draw = "worn" }, { draw = "one" }, { uniform = { k1 = [0.1, 0.2] } }]
load_torque_Nm = { uniform = [-20.0, 20.0] }
tolerances = 1.0
tolerances_of = "all"
effects = [{ pair_of = ["cogging_torque", "hinge_moment", "stribeck_friction"], severities = ["clear", "strong"] }]
seeds = { from = 0, count = 20 }
""",
        )
    )
    every = [task.simulated for task in plan.tasks]
    assert [one.faults for one in load_plan_again(plan)] == [one.faults for one in every]
    assert len({json.dumps(one.faults) for one in every}) == len(every)
    assert all(abs(one.load_torque_Nm) <= 20.0 for one in every) and len({one.load_torque_Nm for one in every}) == 20
    assert all(len(one.effects) == 2 for one in every)
    assert all(0.1 <= one.faults["k1"] <= 0.2 for one in every[40:])
    for one in every:
        for path, value in one.values.items():
            assert abs(value - ACTUATOR.value(path)) <= 3.0 * ACTUATOR.tolerances[path].sigma + 1e-12


def load_plan_again(plan):
    path = Path("again.toml")
    try:
        path.write_text(plan.text, encoding="utf-8")
        return [task.simulated for task in load_plan(path).tasks]
    finally:
        path.unlink()


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_the_whole_library_is_an_axis(tmp_path):
    plan = load_plan(written(tmp_path, '[groups.each]\nCHEAP\neffects = { each = "all", severities = ["clear"] }\n'))
    named = [next(iter(task.simulated.effects)) for task in plan.tasks]
    assert named == [name for name, one in CATALOGUE.items() if not one.duplicates and name != "pendulum_load"]
    for task in plan.tasks:
        assert effects_of(task.simulated.effects)


def test_a_users_own_law_is_hidden(tmp_path):
    plan = load_plan(
        written(tmp_path, '[groups.own]\nCHEAP\neffects = { user_torque = { expression = "-c*omega", c = 1e-3 } }\n')
    )
    with_it = inputs_of(plan.tasks[0])
    without = inputs_of(replace(plan.tasks[0], simulated=replace(plan.tasks[0].simulated, effects={})))
    assert not np.allclose(with_it.fitted[0]["current_A"], without.fitted[0]["current_A"])


@pytest.fixture
def recordings(tmp_path):
    folder = tmp_path / "logs [1]"
    folder.mkdir()
    plan = written(tmp_path, "[groups.one]\nCHEAP\n")
    one = inputs_of(load_plan(plan).tasks[0]).fitted[0]
    for number, name in enumerate(("a", "b", "c")):
        rows = zip(*(one[column][number:] for column in one.signals))
        lines = [",".join(one.signals), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_each_file_of_a_pattern_is_a_task(recordings):
    path = recordings / "p.toml"
    path.write_text(
        '[groups.logs]\ndoes = "compare"\nrecordings = ["*.csv", { fit = ["a.csv", "b.csv"], holdout = ["c.csv"] }]\n'
    )
    plan = load_plan(path)
    assert [task.case for task in plan.tasks] == ["a.csv", "b.csv", "c.csv", "a.csv + b.csv"]
    assert inputs_of(plan.tasks[0]).fitted[0].samples == 501
    assert len(inputs_of(plan.tasks[3]).held) == 1
    whole = (recordings / "c.csv").read_bytes()
    (recordings / "c.csv").write_bytes((recordings / "a.csv").read_bytes())
    with pytest.raises(InputError, match=r"c: is both fitted and held out \(its content is that of a\)"):
        inputs_of(load_plan(path).tasks[3])
    (recordings / "c.csv").write_bytes(whole)
    copy = recordings.parent / "copy.toml"
    copy.write_text(plan.text)
    assert [task.recorded for task in load_plan(copy).tasks] == [task.recorded for task in plan.tasks]


def test_each_folder_of_a_pattern_is_a_task(recordings):
    for unit in ("unit_1", "unit_2"):
        (recordings / unit).mkdir()
        for name in ("a.csv", "b.csv"):
            (recordings / unit / name).write_bytes((recordings / name).read_bytes())
    path = recordings / "p.toml"
    path.write_text(
        '[groups.fleet]\ndoes = "compare"\nrecordings = { each = "unit_*", fit = ["a.csv"], holdout = ["b*"] }\n'
    )
    plan = load_plan(path)
    assert [task.case for task in plan.tasks] == ["unit_1/a.csv", "unit_2/a.csv"]
    assert [Path(one.path).name for task in plan.tasks for one in task.recorded.holdout] == ["b.csv", "b.csv"]
    copy = recordings.parent / "copy.toml"
    copy.write_text(plan.text)
    assert [task.recorded for task in load_plan(copy).tasks] == [task.recorded for task in plan.tasks]
    (recordings / "unit_2" / "b.csv").unlink()
    with pytest.raises(InputError, match=r"no file 'b\*' in .*unit_2"):
        load_plan(path)


def test_a_recording_that_changed_is_another_task_and_the_old_one_says_so(recordings):
    path = recordings / "p.toml"
    path.write_text('[groups.logs]\ndoes = "compare"\nrecordings = "a.csv"\n')
    (before,) = load_plan(path).tasks
    with (recordings / "a.csv").open("a") as file:
        file.write("\n")
    (after,) = load_plan(path).tasks
    assert before.name != after.name
    with pytest.raises(InputError, match=r"a\.csv: has changed since"):
        inputs_of(before)


GROUP = "[groups.g]\nCHEAP\n"
BARE = '[groups.g]\ndoes = "identify"\nruns = "short"\n'
GRID = ", ".join(f"k{i} = {[j / 100 for j in range(100)]}" for i in range(1, 9))
MANY = list(range(2, 2002))
WRONG = {
    "no groups": ("", "has no [groups.NAME]"),
    "unknown entry": ("colour = 1\n" + GROUP, "has no 'colour'; it has schema"),
    "another schema": ("schema = 2\n" + GROUP, "schema 2 is not known"),
    "no toml": ("[groups", "not valid TOML"),
    "unknown kind": ('[groups.g]\ndoes = "guess"\n', "does = 'guess' is not known; it is benchmark or compare or"),
    "unknown option": (GROUP + "colour = 1\n", "[groups.g] has no 'colour'; it has does"),
    "option of another kind": (GROUP + "most_effects = 1\n", "has no 'most_effects'"),
    "unknown run": (GROUP.replace("CHEAP", 'does = "identify"\nruns = "long"'), "no run 'long'; [runs] has short"),
    "no run": ('[groups.g]\ndoes = "identify"\n', "[groups.g] runs: holds nothing"),
    "unknown command": ('[runs.x]\ncommand = "wiggle"\n' + GROUP, "[runs.x] no command 'wiggle'"),
    "unknown fault": (GROUP + "faults = { k9 = 0.1 }\n", "[groups.g] faults: no fault 'k9'"),
    "fault outside": (GROUP + "faults = { uniform = { k1 = [0.0, 2.0] } }\n", "faults: fault k1 = 2 is outside 0 … 1"),
    "unknown draw": (GROUP + 'faults = { draw = "bad" }\n', "faults: no draw 'bad'; there are worn, one"),
    "unknown effect": (GROUP + "effects = { magic = { a = 1 } }\n", "effects: no effect 'magic'"),
    "unknown effect of each": (GROUP + 'effects = { each = ["magic"] }\n', "effects: no effect 'magic'"),
    "unknown severity": (GROUP + 'effects = { each = "all", severities = ["bad"] }\n', "no severity 'bad'"),
    "effect's parameter": (GROUP + "effects = { cogging_torque = { colour = 1 } }\n", "has no parameter 'colour'"),
    "unknown parameter": (GROUP + 'off_by = { "motor.colour" = 1 }\n', "off_by: no parameter 'motor.colour'"),
    "negative noise": (GROUP + "noise_A = -1\n", "noise_A: must be 0 or more, not -1"),
    "noise is text": (GROUP + 'noise_A = "much"\n', "noise_A: takes a number, not 'much'"),
    "unknown algorithm": (BARE + 'algorithm = "magic"\n', "no algorithm 'magic'"),
    "population of one": (BARE + "population = 1\n", "population is from 2 to 100000"),
    "population is text": (BARE + 'population = "many"\n', "Expected int, got str"),
    "empty axis": (GROUP + "noise_A = []\n", "noise_A: holds nothing, so that there is nothing to compute"),
    "empty grid": (GROUP + "faults = { grid = { k1 = [] } }\n", "faults: holds nothing"),
    "no effect is left": (GROUP + 'effects = { each = "all", severities = [] }\n', "effects: holds nothing"),
    "empty setting": (BARE + "algorithm = []\n", "algorithm: holds nothing"),
    "no seeds": (GROUP + "seeds = { from = 0, count = 0 }\n", "seeds: holds nothing"),
    "seeds": (GROUP + "seeds = [-1]\n", "seeds: takes whole numbers from 0"),
    "too many seeds": (GROUP + "seeds = { from = 0, count = 2000000000000 }\n", "seeds: has 2e+12 points, and 1000000"),
    "too many faults": (GROUP + f"faults = {{ grid = {{ {GRID} }} }}\n", "faults: has 1e+16 points, and 1000000 are"),
    "too many settings": (BARE + f"population = {MANY}\niterations = {MANY}\n", "has 4e+06 points, and 1000000 are"),
    "too many cases": (GROUP + f"noise_A = {MANY}\ntolerances = {MANY}\n", "has 4e+06 points, and 1000000 are"),
    "too many tasks": (GROUP + f"noise_A = {MANY}\nseeds = {MANY}\n", "takes the plan to 4000000 tasks, and 1000000"),
    "no actuator": (GROUP + 'actuator = "none.toml"\n', "actuator: none.toml: no such file"),
    "no such shipped": (GROUP + 'actuator = "none"\n', "actuator: no actuator 'none' is shipped"),
    "no recordings": ('[groups.g]\ndoes = "compare"\nrecordings = "*.csv"\n', "no file '*.csv' beside the plan"),
    "simulated and recorded": ('[groups.g]\ndoes = "compare"\nrecordings = "*.csv"\nnoise_A = 1\n', "has no 'noise_A'"),
    "like itself": ('like = "plan.toml"\n', "which is not like this one in turn"),
    "like nothing": ('like = "none.toml"\n', "none.toml: no such file"),
}  # fmt: skip


@pytest.mark.parametrize("groups, told", WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_told_in_one_line(tmp_path, monkeypatch, groups, told):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "plan.toml"
    head = "" if groups.startswith(("schema", "colour", "like")) else None
    written(tmp_path, groups)
    if head is not None:  # entries of the top stand before all tables
        path.write_text(groups.replace("CHEAP", 'does = "identify"\nruns = "short"'))
    with pytest.raises(InputError) as error:
        load_plan(Path("plan.toml"))
    assert told in str(error.value), error.value
    assert str(error.value).isprintable() and str(error.value).startswith(("plan.toml: ", "none.toml: "))


def test_every_kind_says_what_its_rows_say():
    for kind in KINDS.values():
        assert (
            len(set(kind.schema.names)) == len(kind.schema.names) and kind.title and kind.seconds(kind.settings()) > 0
        )
