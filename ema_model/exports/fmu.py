"""The exported model as an FMU for co-simulation, FMI 3.0 or 2.0: source, binary for this platform, description.

fmpy has the standard's headers, checks the FMU and runs it.  An FMU holds `exports/fmi`, the exported C, and refusals
for what the standard's headers list beyond that (model exchange, clocks, values of other types).
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import math
import re
import shutil
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError, quoted
from ema_model.exports import c
from ema_model.exports.exported import Exported, Field
from ema_model.quantities import MOTOR, USER

Array = NDArray[np.float64]

VERSIONS = ("3.0", "2.0")
_OWN = Path(__file__).with_name("fmi")
_HEADERS = {
    "3.0": ("fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h"),
    "2.0": ("fmi2TypesPlatform.h", "fmi2FunctionTypes.h", "fmi2Functions.h"),
}
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # so that the same model is the same file
_OUTPUTS, _INITIAL = 4, 8  # value references, as in fmi/instance.h
_PARAMETERS = _INITIAL + 4


def check() -> None:
    """InputError where no compiler or no fmpy is there."""
    c.compiler()
    if importlib.util.find_spec("fmpy") is None:
        raise InputError("fmpy is not installed, which has FMI's headers and checks FMUs: pip install 'emaviz[export]'")


# --- sources ----------------------------------------------------------------------------------------------------------


def write_fmu(one: Exported, path: Path, version: str = "3.0") -> None:
    """Writes NAME.fmu, compiled for this platform; InputError where the compiler refuses it."""
    import fmpy

    number = version[0]
    with tempfile.TemporaryDirectory(prefix="emaviz-fmu-") as scratch:
        root = Path(scratch)
        sources = root / "sources"
        sources.mkdir()
        headers = Path(fmpy.__file__).with_name("c-code")
        for name in _HEADERS[version]:
            shutil.copy(headers / name, sources)
        for name in ("instance.h", f"fmi{number}.c"):
            shutil.copy(_OWN / name, sources)
        (sources / f"{one.name}.h").write_text(c.header(one), encoding="utf-8")
        (sources / f"{one.name}.c").write_text(c.source(one), encoding="utf-8")
        (sources / "model.h").write_text(_names(one), encoding="utf-8")
        (sources / "refusals.c").write_text(_refusals(sources, version), encoding="utf-8")
        compiled = [f"{one.name}.c", f"fmi{number}.c", "refusals.c"]
        place = fmpy.platform_tuple if version == "3.0" else fmpy.platform
        binary = root / "binaries" / place / f"{one.name}{fmpy.sharedLibraryExtension}"
        binary.parent.mkdir(parents=True)
        c.compile_library([sources / name for name in compiled], binary)
        described = _description3(one) if version == "3.0" else _description2(one, compiled)
        (root / "modelDescription.xml").write_text(described, encoding="utf-8")
        if version == "3.0":
            (sources / "buildDescription.xml").write_text(_build(one, compiled), encoding="utf-8")
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(file for file in root.rglob("*") if file.is_file()):
                info = zipfile.ZipInfo(file.relative_to(root).as_posix(), _ZIP_TIME)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = (0o755 if file == binary else 0o644) << 16
                archive.writestr(info, file.read_bytes())


def token(one: Exported) -> str:
    """What tells this model from any other: a hash of its source."""
    digest = hashlib.sha256((c.header(one) + c.source(one)).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def _names(one: Exported) -> str:
    """model.h."""
    n = one.name
    names = ("parameters", "state", "defaults", "init", "sense", "step", *c.SHOWN)
    lines = [f"#define model_{name} {n}_{name}" for name in names]
    return "\n".join([f'#include "{n}.h"', "", *lines, f"#define MODEL_STEP_S {n.upper()}_STEP_S",
                      f'#define MODEL_TOKEN "{token(one)}"', ""])  # fmt: skip


def _refusals(sources: Path, version: str) -> str:
    """Functions of the standard that this kind of FMU does not have, of the header's own list: they fail."""
    prefix = f"fmi{version[0]}"
    types = (sources / f"{prefix}FunctionTypes.h").read_text(encoding="utf-8")
    types = re.sub(r"/\*.*?\*/", "", types, flags=re.DOTALL)
    known = set(re.findall(rf"\b{prefix}\w+(?=\()", (sources / f"{prefix}.c").read_text(encoding="utf-8")))
    found = [f'#include "{prefix}Functions.h"\n']
    for kind, name, arguments in re.findall(rf"typedef\s+(\w+)\s+({prefix}\w+)TYPE\s*\((.*?)\);", types, re.DOTALL):
        if name not in known:
            value = f"{prefix}Error" if kind == f"{prefix}Status" else "0"
            found.append(f"{kind} {name}({' '.join(arguments.split())})\n{{\n    return {value};\n}}\n")
    return "\n".join(found)


# --- descriptions -----------------------------------------------------------------------------------------------------


def variables(one: Exported) -> list[tuple[int, str, Field]]:
    """Value reference, causality and number of each variable; time is none of them."""
    axes = one.actuator.axes
    supply = Field("supply", 1.0, "", "bus voltage over its nominal value, 0 for a drive that is switched off")
    initial = (
        Field("initial_user_position", 0.0, axes.unit("rad", USER), "where the motor stands, as the user's position"),
        Field("initial_motor_speed", 0.0, axes.unit("rad/s", MOTOR), "motor speed at the start"),
        Field("initial_play", 0.0, axes.unit("rad", MOTOR), "place in the play at the start, 0 the middle"),
        Field("initial_integral", 0.0, axes.unit("N·m", MOTOR), "integral action of the speed loop at the start"),
    )
    return [
        *((place, "input", field) for place, field in enumerate((one.command, one.load, supply), 1)),
        *((place, "output", field) for place, field in enumerate(one.outputs, _OUTPUTS)),
        *((place, "parameter", field) for place, field in enumerate(initial, _INITIAL)),
        *((place, "parameter", field) for place, field in enumerate(one.parameters, _PARAMETERS)),
    ]


def _attributes(one: Exported) -> list[tuple[str, str]]:
    """Of each variable: what it is, and its unit and start, as XML's attributes, which FMI 2 and 3 spell alike."""
    found = []
    for place, causality, field in variables(one):
        fixed = "fixed" if causality == "parameter" else "continuous"
        start = "" if causality == "output" else f' start="{_start(field.value)}"'
        of = f'name="{field.name}" valueReference="{place}" causality="{causality}" variability="{fixed}"'
        found.append((f"{of} description={quoteattr(field.meaning)}", f"{_unit(field)}{start}"))
    return found


def _description3(one: Exported) -> str:
    lines = ['    <Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s"/>']
    lines += [f"    <Float64 {of}{number}/>" for of, number in _attributes(one)]
    outputs = [place for place, causality, _ in variables(one) if causality == "output"]
    return (
        _XML
        + f"""\
<fmiModelDescription fmiVersion="3.0" modelName={_name(one)} instantiationToken="{token(one)}"
    description={_about(one)} generationTool="emaviz">
  <CoSimulation modelIdentifier="{one.name}" canHandleVariableCommunicationStepSize="true"
      fixedInternalStepSize="{one.step_s!r}" canGetAndSetFMUState="true" canSerializeFMUState="true"/>
{_units(one, "3.0")}
  <DefaultExperiment startTime="0" stopTime="1" stepSize="{one.step_s!r}"/>
  <ModelVariables>
{_joined(lines)}
  </ModelVariables>
  <ModelStructure>
{_joined([f'    <Output valueReference="{place}"/>' for place in outputs])}
{_joined([f'    <InitialUnknown valueReference="{place}"/>' for place in outputs])}
  </ModelStructure>
</fmiModelDescription>
"""
    )


def _description2(one: Exported, sources: Sequence[str]) -> str:
    lines = [f"    <ScalarVariable {of}><Real{number}/></ScalarVariable>" for of, number in _attributes(one)]
    outputs = [number for number, (_, causality, _) in enumerate(variables(one), 1) if causality == "output"]
    unknowns = _joined([f'      <Unknown index="{number}"/>' for number in outputs])
    files = _joined([f'      <File name="{name}"/>' for name in sources])
    return (
        _XML
        + f"""\
<fmiModelDescription fmiVersion="2.0" modelName={_name(one)} guid="{token(one)}" description={_about(one)}
    generationTool="emaviz" variableNamingConvention="flat">
  <CoSimulation modelIdentifier="{one.name}" canHandleVariableCommunicationStepSize="true"
      canGetAndSetFMUstate="true" canSerializeFMUstate="true">
    <SourceFiles>
{files}
    </SourceFiles>
  </CoSimulation>
{_units(one, "2.0")}
  <DefaultExperiment startTime="0" stopTime="1" stepSize="{one.step_s!r}"/>
  <ModelVariables>
{_joined(lines)}
  </ModelVariables>
  <ModelStructure>
    <Outputs>
{unknowns}
    </Outputs>
    <InitialUnknowns>
{unknowns}
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
    )


def _build(one: Exported, sources: Sequence[str]) -> str:
    files = _joined([f'      <SourceFile name="{name}"/>' for name in sources])
    return (
        _XML
        + f"""\
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{one.name}" description="C99, without fused sums: -ffp-contract=off">
    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">
{files}
    </SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""
    )


_XML = '<?xml version="1.0" encoding="UTF-8"?>\n'
# Of SI's units by themselves: exponents of kg, m, s, A and rad.
_BASE = {
    "kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "A": {"A": 1}, "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2}, "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ω": {"kg": 1, "m": 2, "s": -3, "A": -2}, "H": {"kg": 1, "m": 2, "s": -2, "A": -2}, "Hz": {"s": -1}, "1": {},
}  # fmt: skip
_POWERS = {"²": 2, "³": 3}


def base_units(unit: str) -> dict[str, int] | None:
    """Exponents of SI's base units in a unit such as N·m·s²/rad or 1/(kg·m²); None for one that is not known."""
    above, _, below = unit.partition("/")
    found: dict[str, int] = {}
    for text, sign in ((above, 1), (below, -1)):
        for factor in filter(None, text.strip("()").split("·")):
            power = _POWERS.get(factor[-1], 1)
            base = _BASE.get(factor.rstrip("²³"))
            if base is None:
                return None
            for name, exponent in base.items():
                found[name] = found.get(name, 0) + sign * power * exponent
    return {name: exponent for name, exponent in found.items() if exponent}


def _units(one: Exported, version: str) -> str:
    units = dict.fromkeys(["s", *(field.unit for _, _, field in variables(one) if field.unit)])
    lines = []
    for unit in units:
        base = base_units(unit)
        exponents = "" if base is None else "".join(f' {name}="{exponent}"' for name, exponent in base.items())
        inner = "" if base is None else f"<BaseUnit{exponents}/>"
        lines.append(f"    <Unit name={quoteattr(unit)}>{inner}</Unit>")
    return f"  <UnitDefinitions>\n{_joined(lines)}\n  </UnitDefinitions>"


def _start(value: float) -> str:
    """As XML spells it."""
    return repr(value) if math.isfinite(value) else repr(value).upper()


def _unit(field: Field) -> str:
    return f" unit={quoteattr(field.unit)}" if field.unit else ""


def _name(one: Exported) -> str:
    return quoteattr(quoted(one.given.name, 100))


def _about(one: Exported) -> str:
    return quoteattr(quoted(" ".join(filter(None, [one.given.description, *one.notes])) or one.given.name))


def _joined(lines: Sequence[str]) -> str:
    return "\n".join(lines)


# --- run --------------------------------------------------------------------------------------------------------------


def problems_of(path: Path) -> list[str]:
    """What fmpy's validation says of an FMU, a line each."""
    from fmpy.validation import validate_fmu

    return [" ".join(str(one).split()) for one in validate_fmu(str(path))]


class RunningFmu:
    """An FMU in fmpy, as a replay takes it: a communication step is a step of the model."""

    def __init__(self, one: Exported, path: Path, folder: Path) -> None:
        """folder: where it is unpacked."""
        import fmpy

        self._one = one
        self._place = str(folder)
        fmpy.extract(str(path), self._place)
        self._description: Any = fmpy.read_model_description(self._place)
        self._is_third = self._description.fmiVersion == "3.0"

    def replay(self, state: Array, parameters: Array, run: tuple[Array, ...], period: int, step_s: float) -> Array:
        """As `c.CompiledC.replay`; the start is set as a user of the FMU sets it."""
        fmu, start = self.instance(), dict(zip((field.name for field in self._one.states), state.tolist()))
        p = dict(zip((field.name for field in self._one.parameters), parameters.tolist()))
        initial = [start["theta"] * p["gear_ratio"], start["omega"], start["play"] - start["theta"], start["integral"]]
        given = [*initial, *parameters.tolist()]
        references = list(range(_INITIAL, _INITIAL + len(given)))
        if self._is_third:
            fmu.setFloat64(references, given)
            fmu.enterInitializationMode(startTime=start["time"])
        else:
            fmu.setupExperiment(startTime=start["time"])
            fmu.setReal(references, given)
            fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        try:
            return self._steps(fmu, start["time"], run, period, step_s)
        finally:
            fmu.terminate()
            fmu.freeInstance()

    def _steps(self, fmu: Any, time_s: float, run: tuple[Array, ...], period: int, step_s: float) -> Array:
        # fmpy's own setters build these arrays anew at each call, which takes longer than the step
        numbers, reference = ctypes.c_double * 4, ctypes.c_uint * 4
        inputs, outputs = numbers(), numbers()
        taken, shown_at = reference(1, 2, 3), reference(*range(_OUTPUTS, _OUTPUTS + 4))
        rows = np.column_stack(run).tolist()
        found = np.empty((len(rows) // period, 4))
        sizes = (3, 4) if self._is_third else ()
        write, read = (fmu.fmi3SetFloat64, fmu.fmi3GetFloat64) if self._is_third else (fmu.fmi2SetReal, fmu.fmi2GetReal)
        for sample in range(len(found)):
            total = 0.0
            for i in range(sample * period, (sample + 1) * period):
                inputs[:3] = rows[i]
                write(fmu.component, taken, 3, inputs, *sizes[:1])
                fmu.doStep(currentCommunicationPoint=time_s + i * step_s, communicationStepSize=step_s)
                read(fmu.component, shown_at, 4, outputs, *sizes[1:])
                total += outputs[0]
            found[sample] = total / period, *outputs[1:]
        return found

    def instance(self) -> Any:
        """One of its own in fmpy, not yet initialized."""
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        about = self._description
        kind = FMU3Slave if self._is_third else FMU2Slave
        fmu = kind(
            guid=about.guid,
            unzipDirectory=self._place,
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName=self._one.name,
        )
        fmu.instantiate()
        return fmu
