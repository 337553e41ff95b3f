"""`emaviz campaign`: bad input in one line, and nothing lost."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil

import pyarrow.parquet as pq
import pytest
from processes import free_port, rows_of
from support.cheap_plans import cheap, written
from support.documents import result_of

from ema_model.campaign import Store, load_plan, run_plan
from ema_model.campaign import store as storing
from ema_model.campaign.rows import row_of
from ema_model.campaign.store import version
from ema_model.errors import InputError
from emaviz.cli import main


class Here:
    """Computes in this process."""

    workers = 1

    def outcomes(self, tasks, version):
        for task in tasks:
            yield [(task, row_of(task, version))]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A campaign of three tasks."""
    folder = tmp_path_factory.mktemp("made")
    plan = cheap(folder, 3)
    run_plan(load_plan(plan), folder / "out", Here())
    return plan, folder / "out"


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made[1], tmp_path / "out")
    return tmp_path / "out"


def told(arguments, capsys):
    assert main([*map(str, arguments), "--quiet"]) == 2
    line = capsys.readouterr().err
    assert line.startswith("emaviz: ") and line.count("\n") == 1 and line.rstrip().isprintable(), line
    return line


def test_a_dry_run_computes_nothing(tmp_path, capsys):
    plan = cheap(tmp_path, 3)
    out = tmp_path / "out"
    assert (
        main(
            [
                "campaign",
                str(plan),
                "--out",
                str(out),
                "--dry-run",
                "--workers",
                "2",
                "--json",
                str(tmp_path / "d.json"),
            ]
        )
        == 0
    )
    shown = capsys.readouterr().out
    assert "3 of 3" in shown and "2 workers: about" in shown and " h (" in shown and "rough" in shown
    assert not out.exists()
    assert result_of(tmp_path / "d.json", "campaign")["tasks"] == 3


@pytest.mark.long
def test_a_dry_run_knows_what_is_there_and_how_long_it_took(made, folder, capsys):
    assert main(["campaign", str(made[0]), "--out", str(folder), "--dry-run"]) == 0
    assert "0 of 3" in (shown := capsys.readouterr().out) and "measured" in shown


def test_the_status_is_told_in_numbers(folder, tmp_path):
    assert main(["campaign", "status", str(folder), "--json", str(tmp_path / "s.json")]) == 0
    told = result_of(tmp_path / "s.json", "campaign")
    assert told["groups"] == {"cheap": {"kind": "identify", "tasks": 3, "rows": 3, "errors": 0}}


@pytest.mark.parametrize(
    "arguments",
    [
        ["campaign", "plan.toml"],
        ["campaign", "status"],
        ["campaign", "report"],
        ["campaign", "status", "a", "--out", "b"],
        ["campaign", "plan.toml", "folder", "--out", "b"],
    ],
)
def test_what_is_missing_is_told(arguments, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cheap(tmp_path, 1)
    assert "campaign takes PLAN --out DIR" in told(arguments, capsys)


def test_plans_that_are_not_there(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "no such file" in told(["campaign", "none.toml", "--out", "o"], capsys)
    assert "no plan 'none'; shipped are" in told(["campaign", "none", "--out", "o"], capsys)
    written(tmp_path, "[groups.g]\nCHEAP\nseeds = []\n")
    assert "seeds: holds nothing" in told(["campaign", "plan.toml", "--out", "o"], capsys)
    assert not (tmp_path / "o").exists()


def test_folders_that_are_none(tmp_path, capsys):
    assert "is no campaign's folder" in told(["campaign", "status", tmp_path], capsys)
    assert "is no campaign's folder" in told(["campaign", "report", tmp_path / "none"], capsys)
    (tmp_path / "mine.txt").write_text("mine")
    plan = cheap(tmp_path, 1)
    assert "holds other files; name a folder that is empty" in told(["campaign", plan, "--out", tmp_path], capsys)
    assert "holds other files" in told(["campaign", plan, "--out", tmp_path / "mine.txt"], capsys)
    (tmp_path / "campaign.json").write_text("{")
    assert "campaign.json: cannot be read" in told(["campaign", "status", tmp_path], capsys)


@pytest.mark.long
def test_a_folder_of_another_version_stays_as_it_is(made, folder, capsys):
    header = json.loads((folder / "campaign.json").read_text())
    header["version"]["emaviz"] = "0.0.9"
    (folder / "campaign.json").write_text(json.dumps(header))
    before = rows_of(folder), (folder / "campaign.json").read_bytes()
    line = told(["campaign", made[0], "--out", folder], capsys)
    assert "was made by another version (emaviz 0.0.9 / " in line and "name a new folder" in line
    assert (rows_of(folder), (folder / "campaign.json").read_bytes()) == before
    assert main(["campaign", "status", str(folder)]) == 0  # it can be looked at


def test_a_folder_of_another_plan_stays_as_it_is(folder, tmp_path, capsys):
    other = written(tmp_path, "[groups.other]\nCHEAP\n", "other.toml")
    assert "holds 3 rows that this plan does not ask for" in told(["campaign", other, "--out", folder], capsys)
    assert Store(folder).header.tasks == {"cheap": 3}


def test_a_plan_that_grew_goes_on(folder, tmp_path, made):
    plan = load_plan(cheap(tmp_path, 4, "longer.toml"))
    status = run_plan(plan, folder, Here())
    assert (status.there, status.computed) == (3, 1)
    assert Store(folder).header.tasks == {"cheap": 4}


def test_one_folder_has_one_writer(made, folder, capsys):
    plan = load_plan(made[0])
    writing = storing.Store.writing(folder, Store(folder).header, plan.text, plan.tasks)
    try:
        assert "another campaign is writing there" in told(["campaign", made[0], "--out", folder], capsys)
    finally:
        writing.close()


def test_a_damaged_part_is_named(made, folder, capsys):
    part = next((folder / "parts").glob("*.parquet"))
    part.write_bytes(part.read_bytes()[:-20])
    line = told(["campaign", made[0], "--out", folder], capsys)
    assert part.name in line and "is damaged; remove it, and its tasks are computed again" in line


def test_a_scheduler_that_is_not_there(tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    from ema_model.campaign import run

    monkeypatch.setattr(run, "_CONNECT_S", 0.5)
    plan = cheap(tmp_path, 1)
    address = f"tcp://127.0.0.1:{free_port()}"
    line = told(["campaign", plan, "--out", tmp_path / "o", "--scheduler", address], capsys)
    assert f"--scheduler {address}: nobody answers there" in line
    assert not (tmp_path / "o").exists()
    for wrong in ("127.0.0.1", "tcp://host", "http://host:1"):
        assert "must be an address such as" in told(["campaign", plan, "--out", "o", "--scheduler", wrong], capsys)


class Losing(Here):
    """All its workers are gone for a while."""

    def outcomes(self, tasks, version):
        rows = super().outcomes(tasks, version)
        yield next(rows)
        self.workers = 0
        yield []
        yield []
        self.workers = 1
        yield from rows


def test_workers_that_are_gone_are_told_once(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("ema_model.campaign.scheduler", lambda address, workers: Losing())
    plan = cheap(tmp_path, 2)
    arguments = ["campaign", plan, "--out", tmp_path / "o", "--scheduler", "tcp://127.0.0.1:1", "--quiet"]
    assert main([str(one) for one in arguments]) == 0
    out, err = capsys.readouterr()
    assert "2 tasks, 2 computed now" in out
    assert err == (
        "1 of 2 tasks, no workers: waiting for some; begin some: `dask worker tcp://127.0.0.1:1 --nthreads 1`\n"
    )


def test_without_dask_a_scheduler_says_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    line = told(["campaign", cheap(tmp_path, 1), "--out", tmp_path / "o", "--scheduler", "tcp://127.0.0.1:1"], capsys)
    assert "pip install 'emaviz[cluster]'" in line


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_FSIZE"), reason="no limits of files here")
def test_a_disk_that_takes_no_more_loses_nothing(made, folder, tmp_path):
    """A limit of a file's size stands for the full disk: parts are refused while they are written."""
    plan = load_plan(cheap(tmp_path, 5, "longer.toml"))
    before = rows_of(folder)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, limits[1]))  # above the plan and the actuator, below a part
    try:
        with pytest.raises(InputError, match=r"cannot be written .*what is there is kept"):
            run_plan(plan, folder, Here())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert rows_of(folder) == before
    assert not [name for name in os.listdir(folder / "parts") if not name.endswith(".parquet")]
    assert run_plan(plan, folder, Here()).computed == 2


def test_a_full_disk_is_told_in_its_own_words(made, folder, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(storing.pq, "write_table", full)
    plan = load_plan(cheap(tmp_path, 4, "longer.toml"))
    with pytest.raises(InputError, match="No space left on device"):
        run_plan(plan, folder, Here())


def test_parts_are_joined_and_nothing_is_lost(folder, monkeypatch, tmp_path):
    monkeypatch.setattr(storing, "_MOST_PARTS", 2)
    table = Store(folder).table("identify")
    run_plan(load_plan(cheap(tmp_path, 6, "longer.toml")), folder, Here())
    assert len(list((folder / "parts").glob("*.parquet"))) <= 3
    joined = Store(folder).table("identify")
    names = table["name"].to_pylist()
    assert joined.num_rows == 6
    assert [row for row in joined.to_pylist() if row["name"] in names] == table.to_pylist()


def test_the_table_says_nothing_of_how_it_came_about(folder):
    table = pq.read_table(folder / "identify.parquet")
    assert not {"elapsed_s", "answer_s", "worker", "memory_MB", "finished_s"} & set(table.schema.names)
    assert table["name"].to_pylist() == sorted(table["name"].to_pylist())
    row = table.to_pylist()[0]
    task = Store(folder).task(row)
    assert task.name == row["name"]
    again = row_of(task, version())
    assert all(again[name] == row[name] for name in table.schema.names)
