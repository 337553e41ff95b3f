"""Ctrl-C ends the program, whatever it is doing: importing, compiling, waiting, or ending already."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable

from emaviz.cli.exit_code import ExitCode

_GRACE_S = 1.5  # to close recordings and remove drafts


def until_interrupted(run: Callable[[], int]) -> int:
    """Runs the program and returns its exit code; an interrupt ends the whole process instead, within two seconds.

    It is raised once, as KeyboardInterrupt.  A second one ends the process at once, and so does the first after a
    while: native code holds it up, and callbacks swallow it.  Where interrupts are ignored, they stay ignored.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return run()
    seen = False

    def interrupted(*_: object) -> None:
        nonlocal seen
        if not seen:
            seen = True
            # What breaks from now on, in any thread, breaks because the program ends.
            sys.excepthook = sys.unraisablehook = threading.excepthook = _silent
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupted)
    code = int(ExitCode.INTERRUPTED)
    try:
        _start_watch()
        code = run()
    except BaseException:
        if not seen:
            raise
    if seen:
        # The interpreter's own way to end waits for threads, and takes the ground from those that compile.
        atexit._run_exitfuncs()
        os._exit(code)
    return code


def _silent(*_: object) -> None:
    """In the place of the hooks that print tracebacks."""


def _start_watch() -> None:
    receiving, sending = os.pipe()
    if sys.platform != "win32":
        os.set_blocking(sending, False)  # a pipe that is full must not hold up the system's handler
    # That handler writes there at once, even while the main thread is in native code.
    signal.set_wakeup_fd(sending, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(receiving,), name="interrupts", daemon=True).start()


def _watch(receiving: int) -> None:
    _wait(receiving)
    late = threading.Timer(_GRACE_S, os._exit, (ExitCode.INTERRUPTED,))
    late.daemon = True
    late.start()
    _wait(receiving)
    os._exit(ExitCode.INTERRUPTED)


def _wait(receiving: int) -> None:
    while signal.SIGINT not in os.read(receiving, 1):
        pass
