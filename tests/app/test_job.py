"""The one machine for long runs: what goes on, a pause, a stop that ends or keeps, an end, and how far it is."""

from __future__ import annotations

import threading

from support.on_page import wait_until

from ema_model.errors import InputError
from emaviz.session.jobs import Job, Pace, Waiting, Worker


class Heard:
    """What a job tells."""

    def __init__(self, job):
        self.said, self.ended, self.rests = [], [], []
        job.progressed.connect(lambda *said: self.said.append(said))
        job.ended.connect(self.ended.append)
        job.rests.connect(self.rests.append)


def test_a_job_says_what_goes_on_and_what_came_of_it(worker):
    job, gone_on = Job(worker), []
    heard = Heard(job)
    assert job.begin("Counting", lambda tell: [tell(f"the_{i}", i / 3) for i in range(3)], lambda: "Three.")
    assert not job.begin("Again", gone_on.append), "one at a time"
    wait_until(lambda: heard.ended)
    assert heard.ended == ["Three."] and job.finished and not job.running and not gone_on
    assert [(text, share) for text, _, share in heard.said] == [("the 0", 0.0), ("the 1", 1 / 3), ("the 2", 2 / 3)]
    assert job.begin("Nothing", lambda tell: None)
    wait_until(lambda: len(heard.ended) == 2)
    assert heard.ended[1].startswith("Nothing: done in ")


def test_one_that_rests_lets_quick_jobs_run(worker):
    job, count, quick = Job(worker), [], threading.Event()
    heard = Heard(job)
    enough = threading.Event()

    def work(tell):
        while not enough.is_set():
            count.append(0)
            tell("counting")

    job.begin("Counting", work)
    wait_until(lambda: count)
    job.pause(True)
    assert job.paused and heard.rests == [True]
    worker.post("quick", quick.set)
    assert quick.wait(5.0)
    at = len(count)
    rested = threading.Event()
    rested.wait(0.2)
    assert len(count) <= at + 1, "the one that it was about to say"
    job.pause(False)
    wait_until(lambda: len(count) > at + 1)
    enough.set()
    wait_until(lambda: heard.ended)
    assert not job.paused


def test_a_stop_ends_one_that_tells_and_is_asked_for_by_one_that_keeps(worker, errors):
    job, rows = Job(worker, on_stop=lambda: "As it was."), []
    heard = Heard(job)

    def told(tell):
        while True:
            tell("on")

    def keeps(run):
        while not run.stopping:
            rows.append(0)
            run.say("on")
            yield

    job.begin("Told", told)
    job.pause(True)
    job.stop()  # also one that rests
    wait_until(lambda: heard.ended)
    assert heard.ended == ["As it was."] and not job.finished
    job.begin("Kept", keeps, lambda: f"{len(rows)} rows")
    wait_until(lambda: rows)
    job.stop()
    wait_until(lambda: len(heard.ended) == 2)
    assert heard.ended[1] == f"{len(rows)} rows" and job.finished and not errors


def test_what_fails_is_told_once_and_the_next_can_begin(worker, errors):
    job = Job(worker, on_divergence="check the file")
    heard = Heard(job)

    def diverges(tell):
        raise FloatingPointError("the model diverged")

    job.begin("Bad", diverges)
    wait_until(lambda: heard.ended)
    assert heard.ended == [""] and not job.running and not job.finished
    (error,) = errors
    assert isinstance(error, InputError) and str(error) == "the model diverged; check the file"
    assert job.begin("Good", lambda tell: None)
    wait_until(lambda: len(heard.ended) == 2)


def test_a_worker_that_closes_ends_what_runs(errors):
    worker = Worker("test-compute", errors.append)
    job = Job(worker)
    told = threading.Event()

    def work(tell):
        while True:
            told.set()
            tell("on")

    job.begin("Long", work)
    job.pause(True)
    assert told.wait(5.0)
    worker.close()
    assert not worker._thread.is_alive()


def test_the_second_run_knows_how_far_it_is_by_the_first():
    pace = Pace()
    pace.begin("a")
    assert [pace.at(text, at) for text, at in (("reading", 0.0), ("step 1 of 2", 2.0))] == [None, None]
    pace.end(4.0)
    pace.begin("a")
    assert pace.at("reading", 0.0) == 0.0 and pace.at("reading", 1.0) == 0.25
    assert pace.at("reading", 3.0) == 0.5, "not beyond where the next began"
    assert pace.at("step 2 of 2", 3.0) == 0.5 and pace.at("step 2 of 2", 99.0) == 0.99
    assert pace.at("something new", 3.0) is None
    pace.begin("b")
    assert pace.at("reading", 1.0) is None


def test_why_one_failed_is_kept_until_the_next_begins(worker, errors):
    job = Job(worker, on_divergence="try less")
    heard = Heard(job)

    def refused(tell):
        raise InputError("there is no column of current")

    def diverges(tell):
        raise FloatingPointError("the speed is no more finite")

    for at, (work, why) in enumerate(((refused, "no column of current"), (diverges, "finite; try less")), 1):
        assert job.begin("Comparing", work)
        wait_until(lambda at=at: len(heard.ended) == at)
        assert heard.ended[-1] == "" and why in job.error and len(errors) == at, "it is told as well"
    assert job.begin("Comparing", lambda tell: None)
    wait_until(lambda: len(heard.ended) == 3)
    assert job.error == ""


def test_a_run_that_is_over_at_once_has_begun_before_and_runs_no_more(worker):
    job, said = Job(worker), []
    job.began.connect(lambda title: said.append(f"{title} began"))
    job.ended.connect(said.append)
    for i in range(50):  # its end is on another thread
        wait_until(lambda i=i: job.begin(f"{i}", lambda tell: None, lambda i=i: f"{i} ended"))
    wait_until(lambda: said[-1] == "49 ended")
    assert said == [f"{i} {what}" for i in range(50) for what in ("began", "ended")] and not job.running


def test_what_waits_for_its_turn_says_for_what_and_lets_what_a_person_asks_for_go_first(worker):
    waits, first, order = Job(worker), Job(worker), []
    said, go_on = [], threading.Event()
    waits.waits.connect(said.append)

    def long(tell):
        tell("step 2 of 5")
        while not go_on.wait(0.02):
            tell("step 2 of 5")

    first.begin("Looking", long)
    wait_until(lambda: worker.progress)
    waits.begin_in_turn("Restoring", lambda: waits.begin("Restoring", lambda tell: order.append("restored")), rests=2)
    wait_until(lambda: said)
    assert said[0] == "Restoring: waiting for Looking (step 2 of 5, 0 s) …"
    go_on.set()
    wait_until(lambda: first.begin("Comparing", lambda tell: order.append("compared")))
    wait_until(lambda: len(order) == 2)
    assert order == ["compared", "restored"] and not waits.waiting


def test_runs_that_wait_begin_in_their_order_one_after_another(worker):
    jobs, order, go_on = worker.jobs, [], threading.Event()
    first = Job(worker)

    def long(tell):
        while not go_on.wait(0.01):
            tell("on", 0.5)

    assert first.begin("First", long)
    wait_until(lambda: jobs.running is not None and jobs.running.share == 0.5)
    own = {name: Job(worker) for name in ("second", "third", "fourth")}
    lines = {
        name: Waiting(name, lambda name=name: own[name].begin(name, lambda tell: order.append(name))) for name in own
    }
    for one in lines.values():
        jobs.add(one)
    again = Waiting("second, another", lambda: own["second"].begin("second", lambda tell: order.append("another")))
    jobs.add(again, lines["second"])
    assert [one.title for one in jobs.waiting] == ["second, another", "third", "fourth"], "it keeps its place"
    jobs.remove(lines["third"])
    go_on.set()
    wait_until(lambda: len(order) == 2)
    assert order == ["another", "fourth"] and not jobs.waiting
    wait_until(lambda: jobs.running is None)
    assert jobs.ended is not None and (jobs.ended.job, jobs.ended.stopped) == (own["fourth"], False)


def test_one_that_cannot_begin_waits_no_more_and_lets_the_next_go(worker, errors):
    done = threading.Event()

    def refused():
        raise InputError("its folder is gone")

    worker.jobs.add(Waiting("Refused", refused))
    worker.jobs.add(Waiting("Next", lambda: done.set() or True))
    assert done.wait(5.0) and [str(one) for one in errors] == ["its folder is gone"]
    wait_until(lambda: not worker.jobs.waiting)
