"""The kinds of cases, and how many there are of each."""

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.attack import hdf5_bytes, hdf5_structure, logs, plans, settings, stores
from benchmarks.attack.cases import Maker


@dataclass(frozen=True)
class Kind:
    """Cases of one kind; `make` is None where a case is more than commands on damaged input."""

    title: str
    count: int
    make: Maker | None


KINDS: Mapping[str, Kind] = {
    "settings": Kind("settings: structure, types, units, tags", 8000, settings.make),
    "overrides": Kind("settings by `--set`", 2500, settings.make_override),
    "bytes": Kind("HDF5: bytes and truncations", 5000, hdf5_bytes.make),
    "structure": Kind("HDF5: structure", 1200, hdf5_structure.make),
    "logs": Kind("logs of ten kinds", 2400, logs.make),
    "plans": Kind("plans of campaigns", 200, plans.make),
    "stores": Kind("results of campaigns", 100, stores.make),
    "kills": Kind("kills", 40, None),
}
