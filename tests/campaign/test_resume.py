"""Whatever is killed, the same command goes on: no row is lost, none is computed again, and the table is the same."""

from __future__ import annotations

import contextlib
import os
import signal
import sys

import pytest
from processes import begun, children_of, cluster, ended, kill, rows_of, wait_for
from support.cheap_plans import cheap, written
from support.documents import result_of

from ema_model.campaign import Store, load_plan

TASKS = 10


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The plan, and the table of a single process that nobody disturbed."""
    folder = tmp_path_factory.mktemp("expected")
    plan = cheap(folder, TASKS)
    told = ended(begun(plan, "--out", folder / "out", "--workers", "1"))
    assert f"{TASKS} tasks, {TASKS} computed now" in told
    return plan, (folder / "out" / "identify.parquet").read_bytes()


def rows_by_name(folder):
    return {row["name"]: row for row in Store(folder).table("identify", how=True).to_pylist()}


@pytest.mark.long
def test_a_worker_and_then_the_client_are_killed(tmp_path, expected):
    plan, table = expected
    out = tmp_path / "out"
    client = begun(plan, "--out", out, "--workers", "2")
    wait_for(lambda: rows_of(out) >= 2)
    workers = children_of(client.pid)
    assert len(workers) == 2
    kill(workers[0])
    wait_for(lambda: len(set(children_of(client.pid)) - {workers[0]}) == 2)  # another took its place
    kept = rows_of(out)
    wait_for(lambda: rows_of(out) > kept)
    kill(client.pid)
    client.communicate()
    wait_for(lambda: not any(alive(pid) for pid in workers))  # workers end with their client
    kept = rows_by_name(out)
    assert 3 <= len(kept) < TASKS
    told = ended(begun(plan, "--out", out, "--workers", "2"))
    assert f"{TASKS - len(kept)} computed now, {len(kept)} were there" in told
    assert (out / "identify.parquet").read_bytes() == table
    whole = rows_by_name(out)
    assert {name: whole[name] for name in kept} == kept  # to the second in which they were computed
    assert "0 computed now" in ended(begun(plan, "--out", out))
    assert {*load_plan(plan).tasks[0].as_json()} and (out / "plan.toml").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a worker that is stopped cannot end itself")
def test_a_client_that_is_killed_leaves_no_worker_and_the_same_line_goes_on(tmp_path):
    """Its worker is held in the middle of a task, which it could not end by itself."""
    out = tmp_path / "out"
    line = cheap(tmp_path, 6), "--out", out, "--workers", "1"
    client = begun(*line)
    wait_for(lambda: rows_of(out) >= 1)
    [worker] = children_of(client.pid)
    os.kill(worker, signal.SIGSTOP)
    try:
        kill(client.pid)
        client.wait()
        wait_for(lambda: not alive(worker), 10.0)
    finally:
        with contextlib.suppress(ProcessLookupError):
            kill(worker)
        client.communicate()
    kept = rows_of(out)
    assert f"{6 - kept} computed now, {kept} were there" in ended(begun(*line))
    assert rows_of(out) == len(rows_by_name(out)) == 6


def alive(pid):
    import psutil

    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


def test_an_interrupt_keeps_the_rows_and_leaves_no_worker(tmp_path):
    out = tmp_path / "out"
    client = begun(cheap(tmp_path, 200), "--out", out, "--workers", "2")
    wait_for(lambda: rows_of(out) >= 1)
    workers = children_of(client.pid)
    client.send_signal(signal.SIGINT)
    told = ended(client, 130)
    wait_for(lambda: not any(alive(pid) for pid in workers))
    rows = rows_of(out)
    assert 1 <= rows < 200
    assert told == f"{out}: interrupted, {rows} of 200 tasks have a row; the same line goes on from there\n"


@pytest.mark.long
def test_on_dask_a_worker_the_client_and_the_scheduler_are_killed(tmp_path, expected):
    pytest.importorskip("distributed")
    plan, table = expected
    out = tmp_path / "out"
    with cluster(tmp_path) as dask:
        client = begun(plan, "--out", out, "--scheduler", dask.address)
        wait_for(lambda: rows_of(out) >= 1)
        kill(dask.worker_processes()[0])
        kept = rows_of(out)
        wait_for(lambda: rows_of(out) > kept)
        kill(client.pid)
        client.communicate()
        kept = rows_of(out)
        assert kept < TASKS
        client = begun(plan, "--out", out, "--scheduler", dask.address)
        wait_for(lambda: rows_of(out) > kept or client.poll() is not None)
        dask.end()  # the scheduler, and all workers with it
        told = ended(client, 2)
        assert told.count("\n") == 1 and "has gone; all rows so far are kept" in told
        kept = rows_by_name(out)
        assert len(kept) < TASKS
        dask.begin()
        told = ended(begun(plan, "--out", out, "--scheduler", dask.address))
        assert f"{TASKS - len(kept)} computed now, {len(kept)} were there" in told
        again = dask.times_begun()
        callbacks = callbacks_of(dask.address)
    assert (out / "identify.parquet").read_bytes() == table
    whole = rows_by_name(out)
    assert {name: whole[name] for name in kept} == kept
    assert callbacks and not any("profile" in name for names in callbacks for name in names)
    # A task is begun again only where a kill met it before its row was kept.
    assert len(set(again)) == TASKS and len(again) - TASKS <= 3 * 2 * 3


def callbacks_of(address):
    """What its workers do from time to time."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        found = client.run(lambda dask_worker: list(dask_worker.periodic_callbacks))
    return list(found.values())


@pytest.mark.long
def test_what_fails_is_a_row_and_not_the_end(tmp_path):
    broken = "[groups.broken]\nCHEAP\nload_torque_Nm = [0.0, 1e7]\n"
    out = tmp_path / "out"
    plan = written(tmp_path, broken)
    assert "2 tasks, 2 computed now, 1 of them errors" in ended(begun(plan, "--out", out, "--workers", "1"))
    rows = Store(out).table("identify").to_pylist()
    (error,) = [row["error"] for row in rows if row["error"]]
    assert error.startswith("InputError: the load torque must be a number of N·m up to 1e6")
    assert "0 computed now, 2 were there" in ended(begun(plan, "--out", out, "--workers", "1"))
    assert "1 computed now, 1 of them errors" in ended(begun(plan, "--out", out, "--workers", "1", "--retry"))
    told = ended(begun("report", out))
    assert "| broken | load 1e+07 N·m | 1 | 1 |" in told and "### Errors" in told
    assert (out / "report.html").stat().st_size > 1e6
    told = ended(begun("status", out, "--json", tmp_path / "s.json"))
    assert "Plan" not in told and "plan: done" in told
    assert result_of(tmp_path / "s.json", "campaign")["groups"]["broken"]["errors"] == 1


@pytest.mark.long
def test_a_task_that_ends_its_workers_is_an_error_in_the_end(tmp_path, expected):
    """Killed as often as it is begun, it gives way."""
    plan = cheap(tmp_path, 1)
    out = tmp_path / "out"
    client = begun(plan, "--out", out, "--workers", "1", EMAVIZ_CACHE_DIR=str(tmp_path / "cold"))  # seconds to compile
    seen = set()
    for _ in range(3):
        wait_for(lambda: (set(children_of(client.pid)) - seen and busy(client.pid)) or client.poll() is not None)
        for pid in children_of(client.pid):
            seen.add(pid)
            kill(pid)
    assert "1 tasks, 1 computed now, 1 of them errors" in ended(client)
    [row] = Store(out).table("identify").to_pylist()
    assert "3 workers ended while they computed it" in row["error"]


def busy(pid):
    """Whether a worker has begun to compute: it has taken more processor time than its imports do."""
    import psutil

    return any(psutil.Process(one).cpu_times().user > 2.5 for one in children_of(pid))
