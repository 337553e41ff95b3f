"""What is hidden in a challenge.  Nothing that looks for effects may read this."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.effects import find
from ema_model.errors import InputError, quoted
from ema_model.faults import vector

KIND = "kind"  # in the truth of a challenge of another kind than effects, which `ema_model.practice` reads
_KEYS = {"schema", "seed", "answer", "torque", "torque_parameters", "effects", "faults"}


@dataclass(frozen=True)
class Truth:
    """The plant behind a challenge's recordings."""

    name: str
    seed: int  # of the plant's parameters, and of the sensors' noise
    answer: str  # in words, for when the student is done
    effects: dict[str, dict[str, float]] = field(default_factory=dict)  # of the catalogue, with their settings
    torque: str = ""  # outside the catalogue: an expression of `ema_model.effects.user`, N·m at the motor
    torque_parameters: dict[str, float] = field(default_factory=dict)
    faults: dict[str, float] = field(default_factory=dict)  # k1 … k8 that are not healthy

    @property
    def k(self) -> NDArray[np.float64]:
        """All faults of the plant, (8,)."""
        return vector(self.faults)


def truths(where: Path) -> list[Truth]:
    """The truths of a folder of challenges of effects, by name; InputError tells a mistake."""
    found = {path: read_toml(path) for path in sorted((where / "truth").glob("*.toml"))}
    return [truth_of(told, path.stem, str(path)) for path, told in found.items() if KIND not in told]


def read_truth(path: Path) -> Truth:
    """One truth; InputError tells a mistake."""
    return truth_of(read_toml(path), path.stem, str(path))


def read_toml(path: Path) -> dict[str, Any]:
    """The text of a truth of any kind; InputError for what is none."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{quoted(path)}: not a challenge's truth: {quoted(error)}") from None


def truth_of(told: Mapping[str, Any], name: str, where: str) -> Truth:
    """The truth that a file tells; InputError, which begins with `where`, tells a mistake."""
    if unknown := told.keys() - _KEYS:
        raise InputError(f"{where}: {quoted(min(unknown))} is not known; known are {', '.join(sorted(_KEYS))}")
    try:
        effects = {effect: find(effect).settings(dict(given)) for effect, given in told.get("effects", {}).items()}
        faults = {fault: float(value) for fault, value in told.get("faults", {}).items()}
        vector(faults)
        return Truth(
            name,
            int(told["seed"]),
            str(told["answer"]).strip(),
            effects,
            str(told.get("torque", "")),
            {parameter: float(value) for parameter, value in told.get("torque_parameters", {}).items()},
            faults,
        )
    except KeyError as error:
        raise InputError(f"{where}: {error.args[0]} is missing; add it") from None
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"{where}: not a challenge's truth: {quoted(error)}") from None
