"""Groups, variables, links and attributes of dataset and estimate files that are not what they should be."""

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from benchmarks.attack.cases import Case
from benchmarks.attack.hdf5_commands import on_dataset, on_estimate
from benchmarks.attack.material import Material

_HOSTILE: tuple[Any, ...] = (
    "../../../outside",
    "/tmp/auvid-attack-outside",
    "",
    "x" * 60_000,
    "\x1b[31mred\x07",
    "line\nbreak: [",
    "=cmd()",
    "nul\0inside",
    "completed; rm -rf /",
    "é\ud83d".encode("utf-8", "surrogatepass"),
    b"\xff\xfe",
    -1,
    2**63 - 1,
    np.nan,
    np.inf,
    1 + 2j,
    np.arange(3),
    h5py.Empty("f8"),
    True,
)
# Settings are YAML.
_SETTINGS = (
    "!!python/object/apply:os.system ['true']",
    "{",
    "[]",
    "a: &a [*a]",
    "!!bool foo",
    "name: [",
    "seed: 1\n" * 3,
    "\t",
)


_READ = "mean", "time", "covariance", "inputs/rudder", "inputs/time", "sensors/dvl/u", "sensors/gyroscope/time"
# Of an estimate; what says which versions wrote it hardly matters.
_ATTRIBUTES = "filter", "status", "steps", "cpu_time_s", "wall_time_s", "dataset_sha256", "kind", "schema_version"


def _variables(file: h5py.File) -> list[str]:
    names: list[str] = []
    file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return names


def _put(file: h5py.File, name: str, values: Any, **options: Any) -> None:
    """Put another variable in place of one, with its attributes of meaning but without its scales."""
    del file[name]
    file.create_dataset(name, data=values, **options)


def _retyped(rng: random.Random, values: np.ndarray) -> tuple[Any, str, bool]:
    if values.dtype.kind == "O":
        kind = rng.choice(("number", "bytes", "hostile"))
        made = {
            "number": np.arange(values.size, dtype=float),
            "bytes": np.full(values.shape, b"\xff\xfe", dtype="S4"),
            "hostile": np.array(["../../x", *["X_u|u|"] * values.size][: values.size], dtype=object),
        }[kind]
        return made, kind, kind == "number"
    makers: dict[str, Callable[[], Any]] = {
        "complex": lambda: values + 1j,
        "text": lambda: np.full(values.shape, b"fast", dtype="S4"),
        "bool": lambda: np.ones(values.shape, bool),
        "int8": lambda: np.ones(values.shape, np.int8),
        "compound": lambda: np.zeros(values.shape, dtype=[("a", "f8"), ("b", "i4")]),
        "float16": lambda: values.astype(np.float16),
        "big endian": lambda: values.astype(">f8"),
        "huge": lambda: np.full(values.shape, np.finfo(np.longdouble).max, np.longdouble),
        "enum": lambda: values.astype(np.int64),
        "void": lambda: np.full(values.shape, b"12345678", dtype="V8"),
    }
    kind = rng.choice(list(makers))
    return makers[kind](), kind, kind in ("complex", "text", "compound", "void")


def _reshaped(rng: random.Random, values: np.ndarray) -> tuple[Any, str]:
    kind = rng.choice(("emptied", "scalar", "column", "transposed", "longer", "shorter", "null", "higher", "flat"))
    flat = values.ravel()
    made: Any = {
        "emptied": values[:0],
        "scalar": flat[0] if flat.size else 0.0,
        "column": values[..., None],
        "transposed": values.T if values.ndim > 1 else values[None, :] if values.ndim else values,
        "longer": np.concatenate([flat, flat]),
        "shorter": flat[:-1],
        "null": h5py.Empty("f8"),
        "higher": values.reshape((1,) * 5 + values.shape),
        "flat": flat,
    }[kind]
    return made, kind


def _revalued(rng: random.Random, values: np.ndarray) -> tuple[Any, str]:
    kind = rng.choice(
        ("nan", "one nan", "inf", "negated", "reversed", "shuffled", "zero", "1e300", "1e-300", "repeated")
    )
    changed = values.astype(float).copy()
    one = rng.randrange(changed.size) if changed.size else 0
    if kind == "nan":
        changed[...] = np.nan
    elif kind in ("one nan", "inf") and changed.size:
        changed.flat[one] = np.nan if kind == "one nan" else rng.choice((np.inf, -np.inf))
    elif kind == "negated":
        changed = -changed
    elif kind == "reversed" and changed.ndim:
        changed = changed[::-1]
    elif kind == "shuffled" and changed.ndim:
        changed = changed[rng.sample(range(len(changed)), len(changed))]
    elif kind == "zero":
        changed[...] = 0.0
    elif kind in ("1e300", "1e-300"):
        changed = changed * float(kind)
    elif kind == "repeated" and changed.size > 1:
        changed.flat[one] = changed.flat[one - 1]
    return changed, kind


def _change_variable(rng: random.Random, file: h5py.File) -> tuple[str, bool]:
    names = _variables(file)
    # Most are of the truth, of raw sensors or of innovations, which not every command needs.
    read = [name for name in names if name in _READ]
    name = rng.choice(read if read and rng.random() < 0.5 else names)
    how = rng.choice(("type", "type", "shape", "shape", "value", "value", "value", "remove"))
    values = file[name][()]
    if how == "remove":
        del file[name]
        return f"{name} removed", False
    if how == "type":
        made, kind, refused = _retyped(rng, values)
        needed = name in _READ
        _put(file, name, made)
        return f"{name} as {kind}", refused and needed
    made, kind = _reshaped(rng, values) if how == "shape" or values.dtype.kind == "O" else _revalued(rng, values)
    _put(file, name, made)
    return f"{name} {kind}", False


def _change_link(rng: random.Random, file: h5py.File) -> tuple[str, bool]:
    names: list[str] = []
    file.visit(names.append)
    name = rng.choice(names)
    kind = rng.choice(
        ("group", "soft", "loop", "ring", "external", "own external", "hard loop", "named type", "dangling")
    )
    del file[name]
    if kind == "group":
        file.create_group(name)
    elif kind == "soft":
        file[name] = h5py.SoftLink(rng.choice([other for other in names if not other.startswith(name)] or ["/"]))
    elif kind == "loop":
        file[name] = h5py.SoftLink(f"/{name}")
    elif kind == "ring":
        file[name] = h5py.SoftLink("/ring")
        file["ring"] = h5py.SoftLink(f"/{name}")
    elif kind == "external":
        file[name] = h5py.ExternalLink(rng.choice(("/etc/passwd", "/dev/zero", "nowhere.h5", "../../x.h5")), "/x")
    elif kind == "own external":
        file[name] = h5py.ExternalLink(Path(file.filename).name, f"/{name}")
    elif kind == "hard loop":
        file[name] = file["/"]
    elif kind == "named type":
        file[name] = np.dtype("f8")
    else:
        file[name] = h5py.SoftLink("/nowhere")
    return f"{name} as {kind}", False


def _change_attribute(rng: random.Random, file: h5py.File) -> tuple[str, bool]:
    names = list(file.attrs)
    name = rng.choice([name for name in names if name in _ATTRIBUTES] if rng.random() < 0.7 else names)
    if rng.random() < 0.15:
        del file.attrs[name]
        return f"attribute {name} removed", False
    if name == "settings" or rng.random() < 0.15:
        text = str(file.attrs["settings"])
        at = rng.randrange(len(text))
        value = rng.choice((*_SETTINGS, text[:at], text[:at] + rng.choice("{}[]:&*!|>%@`\t\"'#,-?0") + text[at + 1 :]))
        file.attrs["settings"] = value
        return f"attribute settings as {value[:40]!r}...", False
    value = rng.choice(_HOSTILE)
    file.attrs[name] = value
    wrong = name == "filter" or (name in ("status", "kind") and isinstance(value, (str, bytes)))
    return f"attribute {name} as {str(value)[:40]!r}", wrong


def _add(rng: random.Random, file: h5py.File) -> tuple[str, bool]:
    """Add something that is not expected at all."""
    kind = rng.choice(("sensor", "variables", "deep", "attribute"))
    if kind == "sensor":
        file.create_group(rng.choice(("sensors/sonar", "sensors/é", "innovations/sonar", "sensors/dvl2/deep")))
    elif kind == "variables":
        for number in range(200):
            file[f"extra{number}"] = number
    elif kind == "deep":
        file.create_group("/".join(["deep"] * 200))
    else:
        file.attrs["extra"] = "x" * 1000
    return f"{kind} added", False


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case."""
    on, sound = rng.choice(
        (
            (on_dataset, material.results / "dataset.h5"),
            (on_estimate, material.results / "estimates" / "tukf.h5"),
        )
    )
    path = folder / "damaged.h5"
    shutil.copyfile(sound, path)
    change = rng.choice((_change_variable, _change_variable, _change_link, _change_attribute, _change_attribute, _add))
    with h5py.File(path, "a") as file:
        try:
            what, refused = change(rng, file)
        except (ValueError, OSError, TypeError) as error:
            # HDF5 does not let everything be written; what stands there by then is a case as well.
            what, refused = f"{change.__name__.strip('_')}: {error}", False
    name, commands = on(rng, material, folder)
    return Case(f"{name}: {what}", commands, refused)
