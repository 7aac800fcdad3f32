"""Numbers at the limits: what a command accepts and writes, every later command must read."""

import random
import shutil
import struct
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from benchmarks.attack.cases import Case
from benchmarks.attack.material import Material

_EPOCH = 1_743_805_382.0
_SIZES = 1e300, 1e155, 1e50, 1e21, 1e9, 1e6, 1e-20, 1e-160, 5e-324, 0.0
_DATES = "0000", "0001", "1600", "1677", "1678", "1700", "1970", "2261", "2262", "9999", "10000"
_CLOCKS = "99:99:", "99:59:", "24:00:", "23:60:", "75:", "60:", "59:"
_ERRORS = (
    *("gyroscope.bias", "gyroscope.drift", "accelerometer.bias", "dvl.noise", "dvl.bias", "gyroscope.noise"),
    *("dvl.scale_error", "attitude.bias", "gyroscope.quantisation", "dvl.delay"),
)
_ARRAYS = (
    *("sensors/dvl/standard_deviation", "sensors/gyroscope/standard_deviation", "sensors/dvl/u", "inputs/rudder"),
    *("sensors/dvl/time", "inputs/time", "truth/u", "truth/true_coefficient"),
)
_ESTIMATED = "mean", "standard_deviation", "covariance", "held_value", "innovations/dvl/standard_deviation"
_ULOG = b"ULog\x01\x12\x35\x01" + bytes(8)
_TABLE = b"att:uint64_t timestamp;float roll;float pitch;"


def _times(rng: random.Random, rows: list[list[str]]) -> str:
    """Change the times of a log."""
    kind = rng.choice(("zero", "jump", "unit", "date", "clock", "back"))
    row = rng.choice((1, 2, len(rows) // 2, len(rows) - 1))
    seconds = [float(line[0]) for line in rows[1:]]
    if kind == "zero":
        times = [f"{_EPOCH + second:.6f}" for second in seconds]
        times[row - 1] = "0"
    elif kind in ("jump", "back"):
        size = rng.choice((1e3, 1e6, 9e7, 1.1e8, 1e9, 1e15)) * (1.0 if kind == "jump" else -1.0)
        times = [f"{second + (size if number >= row else 0.0):.6f}" for number, second in enumerate(seconds, 1)]
    elif kind == "unit":
        factor, begin = rng.choice((1e3, 1e6, 1e9)), rng.choice((0.0, _EPOCH))
        times = [f"{(begin + second) * factor:.0f}" for second in seconds]
    elif kind == "date":
        years = ["2025"] * len(seconds) if rng.random() < 0.5 else [rng.choice(_DATES)] * len(seconds)
        years[row - 1] = rng.choice(_DATES)
        times = [f"{year}-04-04T00:00:{second:06.3f}Z" for year, second in zip(years, seconds, strict=True)]
    else:
        times = [
            f"{rng.choice(_CLOCKS) if number == row else '00:00:'}{second:06.3f}"
            for number, second in enumerate(seconds, 1)
        ]
    for line, time in zip(rows[1:], times, strict=True):
        line[0] = time
    return f"{kind}, row {row}"


def _imported(rng: random.Random, material: Material, folder: Path) -> Case:
    rows = [line.split(",") for line in (material.logs / "csv.csv").read_text().splitlines()]
    if rng.random() < 0.8:
        what = _times(rng, rows)
    else:
        column, size = rng.randrange(1, len(rows[0])), rng.choice(_SIZES)
        what = f"{rows[0][column]} {size:g}"
        rows[rng.randrange(1, len(rows))][column] = repr(size)
    (folder / "csv.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    vehicle = material.configs / "vehicles" / "vt690.yaml"
    shutil.copyfile(vehicle, folder / "vehicle.yaml")
    (folder / "map.yaml").write_text((material.logs / "csv.yaml").read_text().replace(str(vehicle), "vehicle.yaml"))
    commands = (
        ("import", "-m", "map.yaml", "-o", "out/made.h5"),
        ("identify", "out/made.h5", "-f", "tukf", "-o", "out/seen"),
    )
    return Case(f"import, {what}", commands, readable=True)


def _simulated(rng: random.Random) -> Case:
    key, size = rng.choice(_ERRORS), rng.choice(_SIZES)
    commands = (
        ("simulate", "--set", "manoeuvre.duration=2 s", "--set", f"sensors.{key}={size!r}", "-o", "out"),
        ("identify", "out/dataset.h5", "-f", "tukf", "-o", "out/seen"),
    )
    return Case(f"simulate, {key} {size:g}", commands, readable=True)


def _variable(file: h5py.File, name: str) -> h5py.Dataset:
    item = file[name]
    assert isinstance(item, h5py.Dataset)
    return item


def _changed(rng: random.Random, material: Material, folder: Path) -> Case:
    """Put a number into a dataset or an estimate; what is exported must be a vehicle file."""
    shutil.copytree(material.results, folder / "run")
    is_dataset = rng.random() < 0.5
    path = folder / "run" / ("dataset.h5" if is_dataset else "estimates/tukf.h5")
    name, size = rng.choice(_ARRAYS if is_dataset else _ESTIMATED), rng.choice(_SIZES)
    with h5py.File(path, "a") as file:
        values = _variable(file, name)[...]
        if not values.size:
            name, values = "mean", _variable(file, "mean")[...]
        place = (rng.randrange(len(values)),) * 2 if name == "covariance" else (-1, *[0] * (values.ndim - 1))
        values[place] = rng.choice((1.0, -1.0)) * size
        _variable(file, name)[...] = values
    commands: tuple[tuple[str, ...], ...] = (("identify", "run/dataset.h5", "-f", "tukf", "-o", "out/seen"),)
    if not is_dataset:
        exported = "export", "run/estimates/tukf.h5", "--as", "yaml", "-o", "out/vehicle.yaml"
        commands = exported, ("run", "--dry-run", "--set", "vehicle=out/vehicle.yaml")
    return Case(f"{name} {size:g}", commands, readable=True)


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case of numbers at the limits."""
    kind = rng.random()
    if kind < 0.5:
        return _imported(rng, material, folder)
    return _simulated(rng) if kind < 0.7 else _changed(rng, material, folder)


def _message(kind: bytes, content: bytes) -> bytes:
    return struct.pack("<H", len(content)) + kind + content


def make_large(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a file that is easy to write and long to read; the command must end by itself."""
    kind = rng.choice(("ulog", "ulog", "arrays", "far", "attribute", "rows"))
    size = rng.choice((100_000, 1_000_000, 4_000_000))
    suggest = "import", "--suggest"
    if kind == "ulog":
        head = _message(b"F", _TABLE) + _message(b"A", bytes(3) + b"att") if rng.random() < 0.5 else b""
        rows = b"".join(
            _message(b"D", struct.pack("<HQff", 0, 1000 * k, 0.1, 0.2)) for k in range(rng.choice((0, 100)))
        )
        filling = rng.choice((b"\xff", b"\0", b"\x01\x00\x80", b"\xff\x27\xff", rng.randbytes(size)))
        (folder / "log.ulg").write_bytes(_ULOG + head + rows + (filling * (size // len(filling))))
        return Case(f"ULog, {filling[:3]!r}", ((*suggest, "log.ulg"),), must_end=True)
    if kind == "arrays":
        count = rng.choice((2000, 9000, 30_000))
        arrays: dict[str, Any] = {f"a{k}": np.arange(10.0) for k in range(count)}
        np.savez(folder / "log.npz", **arrays)
        return Case(f"{count} arrays", ((*suggest, "log.npz"),), must_end=True)
    if kind == "rows":
        text = "".join(f"{0.01 * k:.2f},{k % 7},{k % 5}\n" for k in range(size))
        (folder / "log.csv").write_text(f"time,p,q\n{text}")
        return Case(f"{size} rows", ((*suggest, "log.csv"),), must_end=True)
    name, offset = rng.choice(("inputs/time", "sensors/dvl/time", "truth/time")), rng.choice((1e4, 1e6, 9e7))
    shutil.copyfile(material.results / "dataset.h5", folder / "dataset.h5")
    with h5py.File(folder / "dataset.h5", "a") as file:
        if kind == "attribute":
            file.attrs["settings"] = str(file.attrs["settings"]) + "\n#" + "x" * (25 * size)
        else:
            times = _variable(file, name)[...]
            moved = times + offset if rng.random() < 0.5 else np.append(times[:-1], times[-1] + offset)
            _variable(file, name)[...] = moved
    what = f"settings of {25 * size} characters" if kind == "attribute" else f"{name} {offset:g} s off"
    return Case(what, (("inspect", "dataset.h5", "-o", "out"),), must_end=True)
