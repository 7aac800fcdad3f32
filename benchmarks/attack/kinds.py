"""The kinds of cases, and how many there are of each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.attack import hdf5_bytes, hdf5_structure, kills, limits, logs, objects, plans, settings, stores
from benchmarks.attack.cases import Maker
from benchmarks.attack.material import Material
from benchmarks.attack.outcome import Outcome


@dataclass(frozen=True)
class Kind:
    """Cases of one kind: damaged input for commands (`make`), or something else (`perform`)."""

    title: str
    count: int
    make: Maker | None
    perform: Callable[[Path, Material, int, int], Outcome] | None = None


KINDS: Mapping[str, Kind] = {
    "settings": Kind("settings: structure, types, units, tags", 8000, settings.make),
    "overrides": Kind("settings by `--set`", 2500, settings.make_override),
    "bytes": Kind("HDF5: bytes and truncations", 5000, hdf5_bytes.make),
    "structure": Kind("HDF5: structure", 1200, hdf5_structure.make),
    "logs": Kind("logs of ten kinds", 2400, logs.make),
    "plans": Kind("plans of campaigns", 200, plans.make),
    "stores": Kind("results of campaigns", 100, stores.make),
    "limits": Kind("numbers at the limits", 600, limits.make),
    "large": Kind("files that are long to read", 100, limits.make_large),
    "objects": Kind("objects of the Python interface", 2000, None, objects.perform),
    "kills": Kind("kills", 40, None, kills.perform),
}
