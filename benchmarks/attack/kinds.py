"""The kinds of cases, and how many there are of each."""

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.attack import (
    hdf5_bytes,
    hdf5_structure,
    kills,
    limits,
    links,
    logs,
    objects,
    plans,
    settings,
    stores,
    surroundings,
)
from benchmarks.attack.cases import Maker, Performer


@dataclass(frozen=True)
class Kind:
    """Cases of one kind: commands on the input that `make` damages, or all that `perform` does."""

    title: str
    count: int
    make: Maker | None = None
    perform: Performer | None = None


KINDS: Mapping[str, Kind] = {
    "settings": Kind("settings: structure, types, units, tags", 8000, settings.make),
    "overrides": Kind("settings by `--set`", 2500, settings.make_override),
    "bytes": Kind("HDF5: bytes and truncations", 5000, hdf5_bytes.make),
    "structure": Kind("HDF5: structure", 1200, hdf5_structure.make),
    "logs": Kind("logs of ten kinds", 2400, logs.make),
    "plans": Kind("plans of campaigns", 200, plans.make),
    "stores": Kind("results of campaigns", 100, stores.make),
    "links": Kind("links to nothing and in circles", 400, links.make),
    "environment": Kind("environment and files of libraries", 60, perform=surroundings.environment),
    "memory": Kind("limited memory", 60, perform=surroundings.memory),
    "interrupts": Kind("interrupts, and readers that end", 60, perform=surroundings.interrupts),
    "limits": Kind("numbers at the limits", 600, limits.make),
    "large": Kind("files that are long to read", 100, limits.make_large),
    "objects": Kind("objects of the Python interface", 2000, perform=objects.perform),
    "kills": Kind("kills", 40, perform=kills.perform),
}
