"""The compute thread: one thread, latest wins, one long job, errors told and survived."""

from __future__ import annotations

import itertools
import threading
import time

from emaviz.session.jobs import Signal, Worker


def wait_until(condition, seconds=5.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.002)
    assert condition()


def test_every_job_runs_on_the_one_thread(worker):
    names = set()
    done = threading.Semaphore(0)
    threads = [
        threading.Thread(
            target=lambda i=i: worker.post(f"kind {i}", lambda: (names.add(threading.get_ident()), done.release()))
        )
        for i in range(20)
    ]
    for thread in threads:
        thread.start()
    for _ in threads:
        assert done.acquire(timeout=5.0)
    assert len(names) == 1
    assert names != {threading.get_ident()}


def test_the_latest_value_wins(worker):
    gate, seen = threading.Event(), []
    worker.post("gate", lambda: gate.wait(5.0))
    time.sleep(0.02)
    for value in range(100):
        worker.post("slider", lambda value=value: seen.append(value))
    gate.set()
    wait_until(lambda: seen)
    time.sleep(0.02)
    assert seen == [99]


def test_of_what_a_signal_tells_the_latest_is_heard(worker):
    gate, seen = threading.Event(), []
    worker.post("gate", lambda: gate.wait(5.0))
    time.sleep(0.02)
    told, begun, ended = Signal(), Signal(), Signal()
    worker.hear(told, lambda name, number: seen.append((name, number)), each=lambda name, number: name)
    for signal, word in ((begun, "begun"), (ended, "ended")):
        worker.hear(signal, lambda word=word: seen.append(word), kind="run")
    for word in ("first", "second"):
        worker.hear_any((begun,), lambda word=word: seen.append(word))
    for number in range(3):
        for name in ("a", "b"):
            told(name, number)
    begun()
    ended()
    gate.set()
    wait_until(lambda: len(seen) == 5)
    time.sleep(0.02)
    assert seen == [("a", 2), ("b", 2), "ended", "first", "second"]


def test_a_second_long_job_is_refused_until_the_first_ends(worker):
    release = threading.Event()

    def long():
        while not release.is_set():
            time.sleep(0.001)
            yield

    assert worker.start(long(), "Identifying") and worker.doing == "Identifying"
    assert not worker.start(long(), "Comparing") and worker.doing == "Identifying", "as who must wait is told"
    assert worker.busy
    release.set()
    wait_until(lambda: not worker.busy)
    assert worker.doing == "" and worker.start(long())


def test_double_click_from_many_threads_starts_one(worker):
    started = []
    gate = threading.Barrier(16)

    def long():
        for _ in range(50):
            time.sleep(0.001)
            yield

    def click():
        gate.wait()
        started.append(worker.start(long()))

    threads = [threading.Thread(target=click) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(started) == 1


def test_quick_jobs_run_between_the_steps_of_a_long_one(worker):
    order = []

    def long():
        for i in range(5):
            order.append(f"step {i}")
            if i == 1:
                worker.post("quick", lambda: order.append("quick"))
            yield

    worker.start(long())
    wait_until(lambda: not worker.busy)
    assert order == ["step 0", "step 1", "quick", "step 2", "step 3", "step 4"]


def test_errors_are_told_and_the_thread_goes_on(worker, errors):
    worker.post("bad", lambda: 1 / 0)

    def long():
        yield
        raise ValueError("in a step")

    wait_until(lambda: len(errors) == 1)
    worker.start(long())
    wait_until(lambda: len(errors) == 2 and not worker.busy)
    done = threading.Event()
    worker.post("good", done.set)
    assert done.wait(5.0)
    assert [type(error) for error in errors] == [ZeroDivisionError, ValueError]


def test_a_pace_is_kept_and_the_last_value_still_comes(errors):
    worker = Worker("test-screen", errors.append, rest_s=0.05)
    times, values = [], []
    try:
        end = time.monotonic() + 0.5
        last = 0
        while time.monotonic() < end:
            last += 1
            worker.post("draw", lambda value=last: (times.append(time.monotonic()), values.append(value)))
            time.sleep(0.001)
        wait_until(lambda: values and values[-1] == last)
    finally:
        worker.close()
    assert min(b - a for a, b in itertools.pairwise(times)) > 0.045


def test_quick_jobs_run_while_a_long_step_breathes():
    worker = Worker("breathing", on_error=lambda error: None)
    done: list[str] = []
    inside, posted = threading.Event(), threading.Event()

    def steps():
        yield
        inside.set()
        assert posted.wait(5.0)
        worker.breathe()
        done.append("long")

    assert worker.start(steps())
    assert inside.wait(5.0)
    worker.post("quick", lambda: done.append("quick"))
    posted.set()
    for _ in range(500):
        if len(done) == 2:
            break
        time.sleep(0.01)
    worker.close()
    assert done == ["quick", "long"]


def test_a_long_job_makes_room_while_quick_ones_keep_coming(worker):
    """A slider is dragged for a second during an identification, which goes on meanwhile, but slower."""
    steps = 0

    def long():
        nonlocal steps
        while True:
            time.sleep(0.004)
            steps += 1
            yield

    def steps_in_half_a_second(drag):
        before, end = steps, time.monotonic() + 0.5
        while time.monotonic() < end:
            if drag:
                worker.post("slider", lambda: None)
            time.sleep(0.05)
        return steps - before

    worker.start(long())
    # Another process may take the core during the one half second or the other.
    assert any(0 < steps_in_half_a_second(drag=True) < 0.7 * steps_in_half_a_second(drag=False) for _ in range(5))
