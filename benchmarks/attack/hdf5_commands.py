"""Commands that read a damaged dataset or estimate, `damaged.h5` in the folder of the case."""

import os
import random
from contextlib import suppress
from pathlib import Path

from benchmarks.attack.material import Material

_FORMS = "yaml", "json", "python", "matlab", "sdf"
_Commands = tuple[str, tuple[tuple[str, ...], ...]]
# Those that draw take a second or more where the damage does not stop them.
_DATASET = {"identify": 6, "inspect": 1.5, "validate": 2, "export": 4, "check": 2, "report": 1, "identifiability": 0.5}
_ESTIMATE = {"export": 8, "validate": 2, "check": 3, "report": 0.7, "identifiability": 0.5, "prior": 3}


def _drawn(rng: random.Random, weights: dict[str, float]) -> str:
    return rng.choices(list(weights), list(weights.values()))[0]


def on_dataset(rng: random.Random, material: Material, folder: Path) -> _Commands:
    """Pick a command that reads a damaged dataset."""
    estimate = str(material.results / "estimates" / "tukf.h5")
    name = _drawn(rng, _DATASET)
    to = rng.choice(_FORMS)
    command = {
        "identify": ("identify", "damaged.h5", "-f", "tukf", "-o", "out"),
        "inspect": ("inspect", "damaged.h5", "-o", "out"),
        "identifiability": ("identifiability", "damaged.h5", "-o", "out"),
        "validate": ("validate", estimate, "damaged.h5", "-o", "out"),
        "export": ("export", estimate, "--to", to, "--dataset", "damaged.h5", "-o", "out/model"),
    }.get(name, (name, "results"))
    if command[0] in ("check", "report"):
        (folder / "results" / "estimates").mkdir(parents=True)
        # It may be that nothing is there.
        with suppress(FileNotFoundError):
            (folder / "damaged.h5").rename(folder / "results" / "dataset.h5")
        os.link(estimate, folder / "results" / "estimates" / "tukf.h5")
    return f"dataset, {name}", (command,)


def on_estimate(rng: random.Random, material: Material, folder: Path) -> _Commands:
    """Pick a command that reads a damaged estimate."""
    dataset, other = str(material.results / "dataset.h5"), str(material.other)
    name = _drawn(rng, _ESTIMATE)
    to = rng.choice(_FORMS)
    command = {
        "export": ("export", "damaged.h5", "--to", to, "--dataset", dataset, "-o", "out/model"),
        "validate": ("validate", "damaged.h5", other, "-o", "out"),
        "identifiability": ("identifiability", dataset, "--at", "damaged.h5", "-o", "out"),
        "prior": (
            *("identify", other, "-f", "tukf", "-o", "out"),
            *("--set", "identification.prior.from_estimate=damaged.h5"),
        ),
    }.get(name, (name, "results"))
    # Without a name for the output it goes where the file's own words say.
    if name == "export" and rng.random() < 0.3:
        command = command[:-2]
        command = ("export", "results/estimates/tukf.h5", *command[2:])
    if "results" in " ".join(command):
        (folder / "results" / "estimates").mkdir(parents=True)
        if os.path.lexists(folder / "damaged.h5"):
            (folder / "damaged.h5").rename(folder / "results" / "estimates" / "tukf.h5")
        os.link(dataset, folder / "results" / "dataset.h5")
    return f"estimate, {name}", (command,)
