"""LeRobot's folders as sets of recordings: an episode each, columns by the joints' names."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.robot_datasets import write_robot_dataset

from ema_model.errors import InputError
from ema_model.recordings import read_columns
from ema_model.recordings.recording_set import files_of
from emaviz.cli import main

FPS = 500.0
NAMES = {
    "observation.state": ["knee_position_rad", "knee_current_A"],
    "action": ["knee_target_rad"],
}
MAPPING = [
    *("--map=time_s=timestamp", "--map=motor_position_rad=observation.state.knee_position_rad"),
    "--map=current_A=observation.state.knee_current_A",
]
ACTUATOR = [
    *("--controller=unknown", "--set=motor.torque_constant_Nm_A=0.05 fixed", "--set=motor.inertia_kgm2=1e-4±30%"),
    *("--set=motor.dynamic_friction_Nm=0.01±30%", "--set=motor.viscous_friction_Nms_rad=0±1e-5"),
]


def episode(pace: float) -> dict[str, np.ndarray]:
    """A motor of 1.1e-4 kg·m² with 0.012 N·m of friction, moved to and fro."""
    time = np.arange(800) / FPS
    position = 20.0 * np.sin(pace * time)
    speed = np.gradient(position, time)
    current = (1.1e-4 * np.gradient(speed, time) + 0.012 * np.tanh(speed)) / 0.05
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    return {"observation.state": np.column_stack([position, current + noise]), "action": position[:, None]}


@pytest.fixture(scope="module", params=[2, 3])
def dataset(request, tmp_path_factory):
    root = tmp_path_factory.mktemp("robot") / "rig"
    write_robot_dataset(root, request.param, FPS, NAMES, [episode(pace) for pace in (3.0, 5.0, 7.0)])
    assert main(["actuator", "new", str(root.parent / "mine.toml"), *ACTUATOR]) == 0
    return root


def test_columns_have_the_joints_names(dataset):
    found = read_columns(files_of(str(dataset))[0])
    assert list(found)[:3] == [f"{field}.{part}" for field, parts in NAMES.items() for part in parts]
    np.testing.assert_allclose(found["action.knee_target_rad"][:800], episode(3.0)["action"][:, 0].astype("f4"))


def test_episodes_are_recordings_with_names(dataset, tmp_path):
    out = tmp_path / "result.json"
    given = [str(dataset), "--actuator", str(dataset.parent / "mine.toml"), *MAPPING, "--holdout", "*_000001"]
    assert main(["compare", *given, "--json", str(out)]) == 0
    result = json.loads(out.read_text())
    assert [one["name"] for one in result["recordings"]] == ["episode_000000", "episode_000002"]
    assert [one["name"] for one in result["holdout"]] == ["episode_000001"]
    friction = result["calibration"]["parameters"]["motor.dynamic_friction_Nm"]["value"]
    assert friction == pytest.approx(0.012, rel=0.1)


def test_what_is_not_said_is_asked_by_the_joints_names(dataset, tmp_path, capsys):
    servo = tmp_path / "servo.toml"
    assert main(["actuator", "new", str(servo), *ACTUATOR]) == 0
    write_robot_dataset(tmp_path / "two", 3, FPS, {"observation.state": ["hip", "knee"]}, [
        {"observation.state": np.column_stack([np.arange(200.0), np.arange(200.0)])}
    ])  # fmt: skip
    assert main(["compare", str(tmp_path / "two"), "--actuator", str(servo)]) == 2
    told = capsys.readouterr().err
    assert "observation.state.hip (no unit), observation.state.knee (no unit)" in told and told.count("\n") == 1


def test_an_action_is_a_command(tmp_path, capsys):
    """The joints' names as lerobot's SO-101 has them; units stand nowhere, so that they are asked for."""
    path = tmp_path / "one"
    names = {"observation.state": ["elbow_flex.pos"], "action": ["elbow_flex.pos"]}
    write_robot_dataset(path, 3, FPS, names, [dict.fromkeys(names, np.sin(np.arange(200.0))[:, None])])
    assert main(["compare", str(path)]) == 2
    told = capsys.readouterr().err
    assert "'action.elbow_flex.pos' may be command_rad, but it has no unit" in told
    assert "--map 'command_rad=action.elbow_flex.pos[rad]'" in told


def test_lists_without_a_length_of_their_own(tmp_path):
    """As pandas and DuckDB write them: their length stands in the dataset's description alone."""
    write_robot_dataset(tmp_path / "rig", 2, FPS, NAMES, [episode(3.0)])
    path = tmp_path / "rig" / "data" / "chunk-000" / "episode_000000.parquet"
    table = pq.read_table(path)
    lists = table["observation.state"].cast(pa.list_(pa.float32()))
    pq.write_table(table.set_column(0, "observation.state", lists), path, store_schema=False)
    found = read_columns(path)
    np.testing.assert_allclose(
        found["observation.state.knee_current_A"], episode(3.0)["observation.state"][:, 1].astype("f4")
    )
    short = pa.chunked_array([[*lists.to_pylist()[:-1], [1.0]]], pa.list_(pa.float32()))
    pq.write_table(table.set_column(0, "observation.state", short), path, store_schema=False)
    with pytest.raises(InputError, match="some rows have fewer numbers"):
        read_columns(path)


@pytest.mark.parametrize("info", ["", "[]", '{"features": []}', '{"features": {"episode_index": 3, "action": [1]}}'])
def test_a_description_that_is_none_leaves_the_columns(info, tmp_path):
    write_robot_dataset(tmp_path / "rig", 2, FPS, NAMES, [episode(3.0)])
    (tmp_path / "rig" / "meta" / "info.json").write_text(info)
    (file,) = files_of(str(tmp_path / "rig"))
    assert "observation.state.0" in read_columns(file) and "action" in read_columns(file)
