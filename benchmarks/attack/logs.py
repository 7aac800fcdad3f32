"""Damaged logs of every kind that auvid reads."""

import gzip
import random
import re
import shutil
from pathlib import Path

import numpy as np

from benchmarks.attack import odd_files
from benchmarks.attack.cases import Case
from benchmarks.attack.hdf5_bytes import damage
from benchmarks.attack.material import Material

KINDS = "csv", "csv", "csv", "gz", "npz", "mat", "mat73", "bag1", "mcap", "db3", "bin", "tlog"
_FILES = {"csv": "csv.csv", "gz": "gz.csv.gz", "npz": "npz.npz", "mat": "mat.mat", "mat73": "mat73.mat"}
_FILES |= {"bag1": "bag1.bag", "mcap": "mcap", "db3": "db3", "bin": "bin.bin", "tlog": "tlog.tlog"}
_CELLS = (
    *("", "nan", "inf", "-1e400", "1e300", "5_0", "1,5", "1.5 deg", '"', '"1.0', "x" * 200_000, "٣", "=cmd()", "0x1F"),
    *(
        "12:30:45",
        "2001-02-30T00:00:00Z",
        "1e",
        "--1",
        "true",
        "\x00",
        "\x1b[31m",
        "1 000",
        "\xa05",
        "9" * 400,
        "null",
        "#",
    ),
)
_TEXT_DAMAGE = [
    "cell",
    "cell",
    "cell",
    "header",
    "extra",
    "extra",
    "short",
    "comma",
    "comma",
    "semicolon",
    "quote",
    "encoding",
    "back",
    "repeat",
    "names",
    "nameless",
    "twice",
    "ends",
    "empty",
    "blank",
    "columns",
    "units",
    "underscores",
]
# How often the output is a file that is read, or something odd stands in place of a log.
_OVER = 0.06
# How often a CSV file is taken as the inputs of a simulation.
_RECORDED = 0.3
_ENCODINGS = "utf-16", "utf-8-sig", "latin-1", "utf-32", "cp1252"
# Where SQLite and MCAP keep what says how the rest is to be read.
_RECORDS = re.compile(rb"CREATE TABLE|MCAP|#ROSBAG|PK|conn=|op=|\xa3\x95\x80|MAT-file|TREE|HEAP|SNOD|std_msgs|topic")


def _damage_text(rng: random.Random, text: str) -> tuple[bytes, str, bool]:
    """Change a CSV file as text; say also whether it can be no recorded manoeuvre any more."""
    rows = [line.split(",") for line in text.splitlines()]
    kind = rng.choice(_TEXT_DAMAGE)
    row, column = rng.randrange(1, len(rows)), rng.randrange(len(rows[0]))
    delimiter = ","
    if kind == "cell":
        for _ in range(rng.choice((1, 1, 5, 50))):
            rows[rng.randrange(1, len(rows))][rng.randrange(len(rows[0]))] = rng.choice(_CELLS)
    elif kind == "header":
        rows[0][column] = rng.choice((*_CELLS, rows[0][0], "time", "Time (s)", "é", f"{rows[0][column]} (furlong)"))
    elif kind == "extra":
        rows[row] += ["1.0"] * rng.choice((1, 1, 3, 1000))
    elif kind == "short":
        del rows[row][column:]
    elif kind == "comma":
        rows[1:] = [[cell.replace(".", ",") for cell in line] for line in rows[1:]]
    elif kind == "semicolon":
        delimiter = rng.choice((";", "\t", "|", " "))
        rows[1:] = [[cell.replace(".", ",") for cell in line] for line in rows[1:]]
    elif kind == "quote":
        rows[row][column] = rng.choice(('"1.0"', "'1.0'", '"1""0"', '"a\nb"', '"'))
    elif kind == "back":
        rows[row][0] = rng.choice((rows[1][0], "-5", "1e9", "nan", "-inf"))
    elif kind == "repeat":
        rows[row:row] = [rows[row]] * rng.choice((1, 100))
    elif kind == "names":
        rows[0] += [f"column_{n}" for n in range(rng.choice((100, 30_000)))]
    elif kind == "nameless":
        del rows[0]
    elif kind == "twice":
        rows.insert(row, rows[0])
    elif kind == "empty":
        del rows[rng.choice((0, 1, 2)) :]
    elif kind == "blank":
        rows[row] = [""]
    elif kind == "columns":
        rows = [line[:column] for line in rows]
    elif kind == "units":
        rows.insert(1, [rng.choice(("s", "deg", "m/s", "zorkmid", "", "m", "rad/s")) for _ in rows[0]])
    elif kind == "underscores":
        rows[row][column] = rows[row][column].replace(".", "_")
    end = rng.choice(("\n", "\r\n", "\r")) if kind == "ends" else "\n"
    made = end.join(delimiter.join(line) for line in rows) + rng.choice((end, ""))
    encoding = rng.choice(_ENCODINGS) if kind == "encoding" else "utf-8"
    shifted = kind in ("extra", "comma", "nameless")
    return made.encode(encoding, "replace"), f"{kind}, row {row}, column {column}", shifted


class _Planted:
    """What an archive must not make anybody run."""

    def __reduce__(self) -> tuple:
        return Path.touch, (Path("..") / "planted",)


def _damage_arrays(rng: random.Random, path: Path) -> str:
    with np.load(path) as archive:
        arrays: dict[str, np.ndarray] = dict(archive)
    name = rng.choice(list(arrays))
    kind = rng.choice(
        ("pickle", "complex", "text", "empty", "two", "shorter", "scalar", "nan", "structured", "dates", "name")
    )
    values = arrays.pop(name)
    changed = {
        "pickle": np.array([_Planted()] * values.size, dtype=object),
        "complex": values + 1j,
        "text": values.astype("U9"),
        "empty": values[:0],
        "two": np.column_stack([values, values]),
        "shorter": values[:-1],
        "scalar": values[0],
        "nan": np.full_like(values, np.nan),
        "structured": np.zeros(values.shape, dtype=[("a", "f8"), ("b", "U3")]),
        "dates": values.astype("datetime64[s]"),
    }.get(kind, values)
    arrays["../x" if kind == "name" else name] = changed
    np.savez(path, **arrays)
    return f"{name} {kind}"


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case."""
    kind = rng.choice(KINDS)
    name = _FILES[kind]
    source, copy = material.logs / name, folder / name
    if source.is_dir():
        shutil.copytree(source, copy)
        copy = rng.choice([*sorted(copy.iterdir()), max(copy.iterdir(), key=lambda path: path.stat().st_size)])
    else:
        shutil.copyfile(source, copy)
    content = copy.read_bytes()
    shutil.copyfile(material.configs / "vehicles" / "vt690.yaml", folder / "vehicle.yaml")
    text = (material.logs / f"{kind}.yaml").read_text()
    (folder / "map.yaml").write_text(text.replace(str(material.configs / "vehicles" / "vt690.yaml"), "vehicle.yaml"))
    shifted = False
    if kind in ("csv", "gz") and rng.random() < (0.8 if kind == "csv" else 0.4):
        changed, what, shifted = _damage_text(rng, (material.logs / "csv.csv").read_text())
        copy.write_bytes(changed if kind == "csv" else gzip.compress(changed, mtime=0))
    elif kind == "npz" and rng.random() < 0.4:
        what = _damage_arrays(rng, copy)
    else:
        records = tuple(found.start() for found in _RECORDS.finditer(content))
        changed, what = damage(rng, content, records)
        copy.write_bytes(changed)
    imported = "import", "-m", "map.yaml", "-o", "out/made.h5"
    suggested = "import", "--suggest", name, "-o", "out/suggested.yaml"
    command = imported if rng.random() < 0.6 else suggested
    if rng.random() < _OVER:
        read = [name, "map.yaml", "vehicle.yaml"] if command is imported else [name]
        command = (*command[:-1], over := rng.choice(read))
        copy.write_bytes(content)
        return Case(f"{kind}: written over {over}", (command,), refused=True)
    if rng.random() < _OVER:
        what, shifted = odd_files.put(rng, copy), True
    if kind == "csv" and rng.random() < _RECORDED:
        return _recorded(copy, what, shifted)
    return Case(f"{kind}, {copy.name}: {what}", (command,))


def _recorded(path: Path, what: str, refused: bool) -> Case:
    """Take the damaged file as the inputs of a simulation."""
    manoeuvre = f"{{name: recorded, type: recorded, duration: 2 s, speed: 2 m/s, file: {path.name}}}"
    command = "simulate", "--set", f"manoeuvre={manoeuvre}", "-o", "out"
    return Case(f"recorded manoeuvre, {what}", (command,), refused)
