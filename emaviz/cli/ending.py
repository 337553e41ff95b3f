"""How the program ends: its exit code, Ctrl-C, and standard streams that cannot be written."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, TextIO

# --- what the program's exit code says --------------------------------------------------------------------------------


class ExitCode(IntEnum):
    """Each with what it means, as --help has it."""

    DONE = 0, "done"
    # 1 is also what Python ends with itself at an exception that nobody expects.
    FAILED = 1, "an internal failure, or a standard output that cannot be written"
    WRONG_INPUT = 2, "the input or the arguments are wrong"
    INTERRUPTED = 130, "interrupted"  # as shells have it: 128 + SIGINT

    meaning: str

    def __new__(cls, value: int, meaning: str) -> ExitCode:
        code = int.__new__(cls, value)
        code._value_ = value
        code.meaning = meaning
        return code


EXIT_CODES = "exit codes: " + "; ".join(f"{code.value} {code.meaning}" for code in ExitCode)


# --- ctrl-C ends the program, whatever it is doing: importing, compiling, waiting, or ending already ------------------
# A command that has a part of its answer by then prints and writes that first.

_END = b"\0"  # no signal's number
_GRACE_S = 1.5  # to close recordings and remove drafts
_ANSWER_S = 60.0  # the same where a part of the answer is to be made and written, on a busy machine


@dataclass
class _State:
    """Of the interrupts of this process."""

    came: bool = False
    has_answer: bool = False  # a part of it, should an interrupt come now
    is_raised: bool = True


_state = _State()


class PartialAnswer:
    """While a command computes its answer: how much an interrupt leaves of it."""

    def __enter__(self) -> PartialAnswer:
        return self

    def __exit__(self, *_: object) -> None:
        _state.is_raised, _state.has_answer = True, _state.came and _state.has_answer

    def grows(self) -> None:
        """There is a part: from now on an interrupt leaves a minute, not two seconds, to print and write it."""
        _state.has_answer = True

    def is_interrupted(self) -> bool:
        """The same; and from the first question on an interrupt is not raised, so that it breaks no step.

        That holds for `until_interrupted`; without it Python raises every interrupt.
        """
        _state.has_answer, _state.is_raised = True, False
        return _state.came


def until_interrupted(run: Callable[[], int]) -> int:
    """Runs the program and returns its exit code; an interrupt or a refusal ends the whole process instead.

    An interrupt does so within two seconds.  It is raised once, as KeyboardInterrupt.  A second one ends the process at
    once, and so does the first after a while: native code holds it up, and callbacks swallow it.  A `PartialAnswer`
    makes that while longer.  Where interrupts are ignored, they stay ignored.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return run()

    def interrupted(*_: object) -> None:
        if not _state.came:
            _state.came = True
            # What breaks from now on, in any thread, breaks because the program ends.
            sys.excepthook = sys.unraisablehook = threading.excepthook = _silent
            if _state.is_raised:
                raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupted)
    code = int(ExitCode.INTERRUPTED)
    watch = _Watch()
    try:
        watch.start()
        code = run()
    except BaseException:
        if not _state.came:
            raise
    finally:
        if not _state.came:
            watch.end()
    # The interpreter's own way to end waits for threads, and takes the ground from those that compile.  After a refusal
    # nothing is left to do: C++ would take down Arrow's threads, which on a busy machine have hardly begun, and abort.
    if _state.came or code == ExitCode.WRONG_INPUT:
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()
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
        if _state.has_answer and sys.stderr.isatty():
            print("\r\x1b[Kwriting what was found so far; Ctrl-C ends it at once", file=sys.stderr, flush=True)
        late = threading.Timer(_ANSWER_S if _state.has_answer else _GRACE_S, os._exit, (ExitCode.INTERRUPTED,))
        late.daemon = True
        late.start()
        if self._interrupted():
            os._exit(ExitCode.INTERRUPTED)

    def _interrupted(self) -> bool:
        """Waits for an interrupt; False at the end."""
        while (seen := os.read(self._receiving, 1)) != _END:
            if signal.SIGINT in seen:
                return True
        return False


# --- standard streams that are closed, full or no longer read ---------------------------------------------------------
# The program ends with a line and not with a traceback.


def open_closed() -> None:
    """Opens what the shell has closed (`>&-`), so that no file of ours takes its number; stdout still refuses text.

    To be called before anything is opened.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            opened = os.open(os.devnull, os.O_WRONLY if name == "stderr" else os.O_RDONLY)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            setattr(sys, name, open(number, "r" if name == "stdin" else "w", encoding="utf-8", closefd=False))


def until_unwritable(run: Callable[[], int], say: Callable[[str], None]) -> int:
    """Runs the program and returns its exit code: 1, and a line, where its standard output could not be written.

    That nobody reads it any longer, as `| head` does, is no failure.
    """
    out = _Out(sys.stdout)
    sys.stdout = out  # type: ignore[assignment]
    try:
        try:
            return run()
        finally:
            out.flush()
    except OSError as error:
        if error is not out.failure:
            raise
    except SystemExit:  # of --help, whose writing ignores a failure
        if out.failure is None:
            raise
    finally:
        if out.failure is not None:  # what is still to be written must not fail when Python ends
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, out.fileno())
            os.close(nowhere)
    assert out.failure is not None, "else it has returned, or raised"
    if isinstance(out.failure, BrokenPipeError):
        return ExitCode.DONE
    why = out.failure.strerror if out.failure is not None else ""
    say(f"the standard output cannot be written ({why}); check where it goes")
    return ExitCode.FAILED


class _Out:
    """A text stream that remembers how it failed."""

    def __init__(self, to: TextIO) -> None:
        self._to = to
        self.failure: OSError | None = None

    def write(self, text: str) -> int:
        try:
            return self._to.write(text)
        except OSError as error:
            self.failure = error
            raise

    def flush(self) -> None:
        try:
            self._to.flush()
        except OSError as error:
            self.failure = error
            raise

    def __getattr__(self, name: str) -> Any:
        return getattr(self._to, name)
