"""Bytes of dataset and estimate files changed, or their end cut off."""

import random
import re
from functools import cache
from pathlib import Path

from benchmarks.attack import odd_files
from benchmarks.attack.cases import Case
from benchmarks.attack.hdf5_commands import on_dataset, on_estimate
from benchmarks.attack.material import Material

# What HDF5 begins its own records with: damage there is rarer than in the numbers, and worse.
_RECORDS = re.compile(rb"TREE|SNOD|HEAP|OHDR|OCHK|FRHP|FHDB|FHIB|BTHD|BTIN|BTLF|GCOL|FSHD|FSSE|FADB|FAHD|EAHD|\x89HDF")
_REACH = 400
# How often something odd stands in place of a file.
_ODD = 0.01


@cache
def _sound(path: Path) -> tuple[bytes, tuple[int, ...]]:
    content = path.read_bytes()
    return content, tuple(found.start() for found in _RECORDS.finditer(content))


def damage(rng: random.Random, content: bytes, records: tuple[int, ...] = ()) -> tuple[bytes, str]:
    """Return the bytes with some changed, zeroed, repeated, put in or left out, or the end cut off."""
    data = bytearray(content)
    kind = rng.choice(("flip", "flip", "flip", "bit", "zero", "cut", "insert", "remove", "repeat"))
    if kind == "cut":
        del data[rng.randrange(len(data)) :]
        return bytes(data), f"cut to {len(data)} bytes"
    count = rng.choice((1, 1, 2, 5, 20)) if kind in ("flip", "bit") else 1
    places = []
    for _ in range(count):
        near = records and rng.random() < 0.7
        at = rng.choice(records) + rng.randrange(_REACH) if near else rng.randrange(len(data))
        at = min(at, len(data) - 1)
        length = rng.choice((1, 4, 64, 512))
        places.append(at)
        if kind == "flip":
            data[at] = rng.randrange(256)
        elif kind == "bit":
            data[at] ^= 1 << rng.randrange(8)
        elif kind == "zero":
            data[at : at + length] = bytes(len(data[at : at + length]))
        elif kind == "insert":
            data[at:at] = rng.randbytes(length)
        elif kind == "remove":
            del data[at : at + length]
        else:
            data[at:at] = data[at : at + length]
    return bytes(data), f"{kind} at {', '.join(map(str, places))}"


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case."""
    if rng.random() < 0.5:
        content, records = _sound(material.results / "dataset.h5")
        on = on_dataset
    else:
        content, records = _sound(material.results / "estimates" / "tukf.h5")
        on = on_estimate
    damaged, what = damage(rng, content, records)
    (folder / "damaged.h5").write_bytes(damaged)
    if rng.random() < _ODD:
        what = odd_files.put(rng, folder / "damaged.h5")
    name, commands = on(rng, material, folder)
    return Case(f"{name}: {what}", commands)
