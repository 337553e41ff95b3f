"""Ctrl-C ends the program, whatever it is doing: importing, compiling, waiting, or ending already."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable

EXIT_CODE = 130  # as shells have it: 128 + SIGINT
_END = b"\0"  # no signal's number
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
    code = EXIT_CODE
    watch = _Watch()
    try:
        watch.start()
        code = run()
    except BaseException:
        if not seen:
            raise
    finally:
        if not seen:
            watch.end()
    if seen:
        # The interpreter's own way to end waits for threads, and takes the ground from those that compile.
        atexit._run_exitfuncs()
        os._exit(code)
    return code


def _silent(*_: object) -> None:
    """In the place of the hooks that print tracebacks."""


class _Watch:
    """The thread that ends the process where an interrupt does not."""

    def __init__(self) -> None:
        self._receiving, self._sending = os.pipe()
        self._thread = threading.Thread(target=self._run, name="interrupts", daemon=True)

    def start(self) -> None:
        """Begins to watch."""
        if sys.platform != "win32":
            os.set_blocking(self._sending, False)  # a pipe that is full must not hold up the system's handler
        # That handler writes there at once, even while the main thread is in native code.
        signal.set_wakeup_fd(self._sending, warn_on_full_buffer=False)
        self._thread.start()

    def end(self) -> None:
        """Ends the thread: one that Python still finds when it ends is torn away, which can abort the process.

        An interrupt from here on ends the process as the system does.
        """
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.set_wakeup_fd(-1)
        if self._thread.ident is not None:
            os.write(self._sending, _END)
            self._thread.join()

    def _run(self) -> None:
        if not self._interrupted():
            return
        late = threading.Timer(_GRACE_S, os._exit, (EXIT_CODE,))
        late.daemon = True
        late.start()
        if self._interrupted():
            os._exit(EXIT_CODE)

    def _interrupted(self) -> bool:
        """Waits for an interrupt; False at the end."""
        while (seen := os.read(self._receiving, 1)) != _END:
            if signal.SIGINT in seen:
                return True
        return False
