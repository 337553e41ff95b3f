"""What this process starts ends with it, however it ends: a parent of each kind of child is killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import psutil
import pytest

ENDS_S = 10.0  # on a loaded machine; all of them would go on for a minute or longer
HERE = "import time\nfrom ema_model import child_processes\nfrom ema_model.child_processes import *\n"
WAITS = "print('started', flush=True)\ntime.sleep(90)\n"
CHILD = "import time; from ema_model.child_processes import end_with_parent; end_with_parent(); time.sleep(90)"
BY_PIPE = f"import sys; sys.platform = 'another'; {CHILD}"
BY_SYSTEM = CHILD.replace("end_with_parent();", "end_with_parent(lambda: time.sleep(90));")
# What a parent does; then it waits to be killed.
KINDS = {
    "by its pipe": f"child = start_python(['-c', {BY_PIPE!r}])",
    "by the system": f"child = start_python(['-c', {BY_SYSTEM!r}])",
    "another program": "import shutil; child = start_program([shutil.which('sleep'), '90'])",
    "reader of foreign files": """
import threading
from ema_model.files import sandbox
ask = lambda: sandbox.ask("time:sleep", 90, most_bytes=10**9, patience_s=90.0)
threading.Thread(target=ask, daemon=True).start()
""",
    "compiler": """
import os
from ema_model.simulation import pack
os.cpu_count = lambda: 2
pack.compile_ahead([(pack.find_stack("reduced", ["dead_time"]), "traces")], urgent=False)
""",
}


@pytest.fixture
def parent(tmp_path):
    """Starts a parent; its children that live, once it has said that it has started them."""
    started = []
    environment = os.environ | {"EMAVIZ_COMPILE_AHEAD": "1", "EMAVIZ_CACHE_DIR": str(tmp_path)}

    def parent(program):
        one = subprocess.Popen(
            [sys.executable, "-c", HERE + program + "\n" + WAITS], stdout=subprocess.PIPE, text=True, env=environment
        )
        children = []
        started.append((one, children))
        assert one.stdout.readline() == "started\n"
        while not children:
            children += psutil.Process(one.pid).children(recursive=True)
        return one, children

    yield parent
    for one, children in started:
        for each in (one, *children):
            try:
                each.kill()
            except psutil.NoSuchProcess:
                pass
        one.communicate()


def lives(process):
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE


def ended(processes):
    """Whether all of them end soon."""
    until = time.monotonic() + ENDS_S
    while any(lives(one) for one in processes):
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True


linux = pytest.mark.skipif(sys.platform != "linux", reason="the system does not do it")


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=linux if kind in ("by the system", "another program") else ()) for kind in KINDS]
)
def test_a_child_ends_with_a_parent_that_is_killed(parent, kind):
    one, children = parent(KINDS[kind])
    time.sleep(0.3)  # it has begun
    assert all(lives(child) for child in children)
    one.kill()
    assert ended(children)


def test_a_child_outlives_the_thread_that_asked_for_it(parent):
    program = f"""
import threading
thread = threading.Thread(target=start_python, args=(['-c', {CHILD!r}],))
thread.start()
thread.join()
"""
    one, [child] = parent(program)
    time.sleep(0.3)
    assert lives(child)
    one.kill()
    assert ended([child])
