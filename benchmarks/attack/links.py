"""Links to nothing, and in circles, in place of files and folders that a command reads."""

import random
import shutil
from pathlib import Path

from benchmarks.attack.cases import Case
from benchmarks.attack.material import Material

_DRY = "--dry-run"
# Link, and the commands of which each must refuse it.
_PLACES: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...] = (
    ("configs/spiral.yaml", (("run", "configs/spiral.yaml", _DRY), ("simulate", "configs/spiral.yaml", _DRY))),
    ("configs/vehicles/vt690.yaml", (("run", "configs/spiral.yaml", _DRY), ("identify", "configs/spiral.yaml", _DRY))),
    ("configs/sensors/table_iii.yaml", (("run", "configs/spiral.yaml", _DRY),)),
    ("configs/manoeuvres/spiral.yaml", (("run", "configs/spiral.yaml", _DRY),)),
    ("vehicles/remus100.yaml", (("run", _DRY, "--set", "vehicle=vehicles/remus100.yaml"),)),
    ("manoeuvres/multisine.yaml", (("run", _DRY, "--set", "manoeuvre=manoeuvres/multisine.yaml"),)),
    ("spiral", (("run", "spiral", _DRY), ("simulate", "spiral", _DRY))),
    ("mine/experiment.yaml", (("run", "mine", _DRY),)),
    ("regimes", (("campaign", "regimes", _DRY),)),
    ("run/dataset.h5", (("inspect", "run/dataset.h5"), ("report", "run"), ("check", "run"))),
    (
        "run/estimates/tukf.h5",
        (("report", "run"), ("check", "run"), ("export", "run/estimates/tukf.h5", "--to", "yaml")),
    ),
    ("run", (("report", "run"), ("compare", "run", "run"), ("check", "run"))),
    ("map.yaml", (("import", "--map", "map.yaml"),)),
    ("dive.csv", (("import", "--suggest", "dive.csv"),)),
)


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case."""
    place, commands = rng.choice(_PLACES)
    shutil.copytree(material.configs, folder / "configs")
    shutil.copytree(material.results, folder / "run")
    path = folder / place
    if path.is_dir():
        shutil.rmtree(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    target, between = rng.choice(("nowhere", "../nowhere", "/nowhere/at/all", path.name)), rng.random() < 0.3
    if between:
        path.with_name("between").symlink_to(target)
    path.symlink_to("between" if between else target)
    return Case(f"{place} -> {target}{' by another link' * between}", (rng.choice(commands),), refused=True)
