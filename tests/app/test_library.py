"""The Library without a browser: while its kernels compile, that is said, and how long it takes."""

from __future__ import annotations

import threading
from types import SimpleNamespace

from support.on_page import wait_until

from ema_model.actuator import load_actuator
from emaviz.session import explore as module
from emaviz.session.explore import Library


def test_what_compiles_is_told_until_the_run_is_there(worker, monkeypatch):
    monkeypatch.setattr(module, "_TICK_S", 0.05)
    library = Library(SimpleNamespace(worker=worker, actuator=load_actuator()))
    said, felt, go_on = [], [], threading.Event()
    library.events.said.connect(said.append)
    library.events.felt.connect(felt.append)
    library._runs.is_compiled = lambda name: go_on.is_set()
    library._runs.felt = lambda name, settings, run: go_on.wait(30.0) and name
    for _ in range(3):  # a slider that is dragged meanwhile
        library.feel("cogging_torque", {}, "step")
    wait_until(lambda: len(said) > 3)
    assert said[0] == "Compiling the library of effects for this computer, once … about 30 s"
    assert sum(one.name == "emaviz-library" for one in threading.enumerate()) == 1
    go_on.set()
    wait_until(lambda: said[-1] == "")
    wait_until(lambda: felt and not worker.busy)
    before = list(said)
    library.feel("cogging_torque", {}, "step")
    wait_until(lambda: len(felt) > 1)
    assert said == before, "it is there"
