"""Cases of one kind: the first belongs to every run, the rest to the long ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest


def first_of(cases: Sequence[Any]) -> list[Any]:
    """For `parametrize`: what stands first is quick, and as telling as any other."""
    return [cases[0], *(pytest.param(one, marks=pytest.mark.long) for one in cases[1:])]
