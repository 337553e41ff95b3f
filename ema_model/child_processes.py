"""Processes that this one starts end with it, however it ends: done, interrupted or killed.

A Python process of ours calls `end_with_parent`: a thread of it waits for the end of what the parent holds open, and
ends it.  Native code can keep that thread from running; on Linux the system ends the process all the same, and other
programs too.  The system does so when the thread that has started a child ends, so one thread, which lasts as long as
this process, starts all of them.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

T = TypeVar("T")

_PR_SET_PDEATHSIG = 1  # of Linux's prctl
_KILL = 9
# Asks the system to end it with its parent, and becomes the program; ends where the parent has ended meanwhile.
_LAUNCHER = f"""
import ctypes, os, sys
ctypes.CDLL(None).prctl({_PR_SET_PDEATHSIG}, {_KILL})
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""

_lock = threading.Lock()
_starter: ThreadPoolExecutor | None = None
_owner = 0  # the process whose thread that is; a forked one has no such thread


def start_python(arguments: Sequence[str], **options: Any) -> subprocess.Popen[Any]:
    """Starts Python with these arguments, whose program calls `end_with_parent`; its input stays open for this process.

    options: as of `subprocess.Popen`.
    """
    command = [sys.executable, *arguments]
    return on_lasting_thread(lambda: subprocess.Popen(command, stdin=subprocess.PIPE, **options))


def start_program(command: Sequence[str], **options: Any) -> subprocess.Popen[Any]:
    """Starts a program that knows nothing of this; outside Linux it may outlive a parent that is killed.

    command: with the program's whole path; options: as of `subprocess.Popen`.
    """
    if sys.platform == "linux" and sys.executable:
        command = [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(os.getpid()), *command]
    return on_lasting_thread(lambda: subprocess.Popen(command, **options))


def on_lasting_thread(start: Callable[[], T]) -> T:
    """What start() returns, called on the thread that starts all children."""
    global _starter, _owner
    with _lock:
        if _starter is None or _owner != os.getpid():
            from concurrent.futures import ThreadPoolExecutor

            _starter, _owner = ThreadPoolExecutor(1, thread_name_prefix="starter"), os.getpid()
    try:
        started = _starter.submit(start)
    except RuntimeError:  # the interpreter is ending, and takes no more work of threads
        return start()
    return started.result()


def end_with_parent(wait: Callable[[], object] | None = None) -> None:
    """Ends this process as soon as its parent ends; to be called at its begin.

    wait(): returns when the parent has ended, in a thread of its own; without it, when the input closes.
    """
    if sys.platform == "linux":
        with suppress(ImportError, OSError, AttributeError):
            import ctypes

            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)

    def look_on() -> None:
        (wait or _input_closes)()
        os._exit(0)

    threading.Thread(target=look_on, name="parent", daemon=True).start()


def _input_closes() -> None:
    while os.read(0, 1 << 12):  # not by `sys.stdin`, which Python closes at the end while this still waits
        pass
