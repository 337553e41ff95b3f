"""What the program's exit code says."""

from __future__ import annotations

from enum import IntEnum


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
