"""An actuator's model written for other tools, and each of them replayed on recordings."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.exports import c, python
from ema_model.exports.exported import Exported, exported
from ema_model.exports.replay import Proof, proof_of, replayed, shortened
from ema_model.exports.result import Export, TargetProof
from ema_model.recordings import Measurement

Progress = Callable[[str], None]

NAMES = ("c", "python")  # of targets
_MOST_PYTHON_STEPS = 20_000  # of a proof: each takes a fifth of a millisecond


@dataclass(frozen=True)
class Target:
    """What an export can be."""

    title: str
    check: Callable[[], object]  # raises InputError where what it needs is not there
    write: Callable[[Exported, Path, Proof, Progress], TargetProof]


def _write_c(one: Exported, folder: Path, proof: Proof, progress: Progress) -> TargetProof:
    names = f"{one.name}.h", f"{one.name}.c"
    for name, text in zip(names, (c.header(one), c.source(one))):
        (folder / name).write_text(text, encoding="utf-8")
    progress("compiling the C")
    with tempfile.TemporaryDirectory(prefix="emaviz-export-") as scratch:
        for name in names:
            shutil.copy(folder / name, scratch)
        losses = replayed(proof, c.CompiledC(one, Path(scratch)), progress)
    compiled = f"compiled by {Path(c.compiler()).name} {' '.join(c.FLAGS)}"
    return TargetProof("c", "C", names, compiled, tuple(losses))


def _write_python(one: Exported, folder: Path, proof: Proof, progress: Progress) -> TargetProof:
    name = f"{one.name}.py"
    (folder / name).write_text(python.source(one), encoding="utf-8")
    losses = replayed(shortened(proof, _MOST_PYTHON_STEPS), python.ImportedPython(one, folder), progress)
    return TargetProof("python", "Python", (name,), "run with numpy", tuple(losses))


TARGETS = dict(
    zip(NAMES, (Target("C", c.compiler, _write_c), Target("Python", lambda: None, _write_python)), strict=True)
)


def export(
    actuator: Actuator,
    targets: Sequence[str],
    recordings: Sequence[Measurement],
    out: str | os.PathLike[str],
    *,
    name: str = "",
    on_progress: Progress | None = None,
) -> Export:
    """Writes the targets into a new folder, each replayed on the recordings; nothing is written where one fails.

    targets: of `TARGETS`; out: the folder; name: of the files, the actuator's own without one.
    Raises InputError for a target that does not exist or whose tools are not there, a folder that holds something,
    effects that have no form, and recordings that cannot be replayed.
    """
    progress = on_progress or (lambda text: None)
    wanted = list(dict.fromkeys(targets))
    for target in wanted:
        if target not in TARGETS:
            like = did_you_mean(target, TARGETS)
            raise InputError(f"no target {quoted(target)!r}; targets are {', '.join(TARGETS)}{like}")
    if not wanted:
        raise InputError(f"name a target to export to: {', '.join(TARGETS)}")
    folder = check_folder(out)
    for target in wanted:
        TARGETS[target].check()
    one = exported(actuator, name)
    proof = proof_of(one, recordings, progress)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name[:40]}-", dir=folder.parent))
    try:
        proofs = []
        for target in wanted:
            progress(f"writing {TARGETS[target].title}")
            proofs.append(TARGETS[target].write(one, draft, proof, progress))
        found = Export(one, str(out), tuple(proofs), proof.simulated, tuple(m.name for m in recordings))
        draft.chmod(0o777 & ~_umask())
        shutil.rmtree(draft / "__pycache__", ignore_errors=True)
        if folder.is_dir():  # it is empty, and some systems do not put a folder in its place
            folder.rmdir()
        os.replace(draft, folder)
    except OSError as error:
        raise InputError(f"{quoted(folder)}: cannot be written ({error.strerror}); check the disk") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return found


def check_folder(out: str | os.PathLike[str]) -> Path:
    """The folder to write, which is not there yet or is empty; InputError for any other."""
    folder = Path(os.path.realpath(out))
    if folder.is_dir() and not any(folder.iterdir()):
        pass
    elif folder.exists():
        raise InputError(f"{quoted(out)}: exists already; name a folder that is new or empty")
    if not folder.parent.is_dir():
        raise InputError(f"{quoted(out)}: the folder {quoted(folder.parent)} does not exist; make it first")
    if not os.access(folder.parent, os.W_OK):
        raise InputError(f"{quoted(out)}: no permission to write in {quoted(folder.parent)}")
    return folder


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
