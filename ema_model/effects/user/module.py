"""A generated effect as a module under a name that tells its source."""

from __future__ import annotations

import hashlib
import linecache
import sys
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

_FUNCTIONS = Path(__file__).with_name("functions.py").read_text(encoding="utf-8")
_HEAD = """\"\"\"Generated: a user's effect; `ema_model.effects.user.module` has written it.\"\"\"

import numpy as np

from ema_model.physics.jit import scalar
from ema_model.physics.elementary import clamp, sine
from ema_model.effects.user.functions import (
    cosine,
    exponential,
    hyperbolic_tangent,
    larger,
    limited,
    power,
    sign_of,
    smaller,
    square_root,
)
"""
_importing = threading.Lock()


def generated_module(kind: str, kernels: str, parameters: Sequence[str] = ()) -> tuple[str, ModuleType]:
    """Makes a module of these kernels: the effect's name `kind_<hash>`, and the module.

    A stack is kept under its effects' names, so the hash covers all that makes it: what the kernels inline (with a
    function of `functions.py` changed, it is another effect) and the names of the effect's parameters.
    """
    source = f"{_HEAD}\n\n{kernels}"
    whole = "\0".join([_FUNCTIONS, source, *parameters])
    name = f"{kind}_{hashlib.sha256(whole.encode()).hexdigest()[:12]}"
    with _importing:
        return name, _module(name, source)


@cache
def _module(name: str, source: str) -> ModuleType:
    module = ModuleType(f"ema_model_{name}")
    file = f"<{module.__name__}>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)  # as a stack's composition
    exec(compile(source, file, "exec"), vars(module))
    sys.modules[module.__name__] = module  # a stack's composition imports it by this name
    return module
