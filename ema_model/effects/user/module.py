"""A generated effect as a module in the kernels' cache folder, under a name that tells its source."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

from ema_model.errors import InputError
from ema_model.stacks import cache_folder
from ema_model.whole_file import whole_file

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
    """Writes and imports a module of these kernels: the effect's name `kind_<hash>`, and the module.

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
    path = cache_folder() / f"{name}.py"
    try:
        if not path.is_file() or path.read_text(encoding="utf-8") != source:
            _write(path, source)
    except OSError as error:
        raise InputError(f"{path.parent}: the effect cannot be written ({error.strerror}); is the disk full?") from None
    module_name = f"ema_model_{name}"
    spec = importlib.util.spec_from_file_location(module_name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module  # a stack's composition imports it by this name
    spec.loader.exec_module(module)
    return module


def _write(path: Path, source: str) -> None:
    """Whole or not at all, as several processes may want it at once."""
    with whole_file(path) as draft:
        draft.write_text(source, encoding="utf-8")
