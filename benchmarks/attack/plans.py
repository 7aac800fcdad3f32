"""Campaigns of one to 1e18 runs, with axes that make no sense; only their dry run."""

import random
from pathlib import Path
from typing import Any

import yaml

from benchmarks.attack.cases import Case
from benchmarks.attack.material import Material

# More runs than anybody can do.
_TOO_MANY = 1e8
_AXES: tuple[Any, ...] = (
    *(
        {"setting": "seed", "values": [1, 2]},
        {"setting": "name", "values": ["a", "b"]},
        {"setting": "nowhere", "values": [1]},
    ),
    *(
        {"setting": "identification.prior.factor", "values": []},
        {"setting": "identification.prior.factor", "values": [1, 1]},
    ),
    *(
        {"setting": "identification.prior.factor", "values": [float("nan")]},
        {"setting": "sensors.dvl.rate", "values": ["x"]},
    ),
    *(
        {"name": "../x", "levels": {"a": {"sensors.dvl.rate": "5 Hz"}}},
        {"name": "run", "levels": {"/": {}}},
        {"name": "", "levels": {}},
    ),
    {"setting": "vehicle.parameters.m", "draw": {"normal": [1, -1]}, "relative": True},
    {"setting": "vehicle.parameters.m", "draw": {"uniform": [2, 1]}},
    {"setting": "vehicle.parameters.m", "draw": {"log_uniform": [0, 1]}},
    {"setting": "vehicle.parameters.m", "draw": {"normal": [1e300, 1e300]}, "relative": True},
    {"setting": "vehicle.parameters.m", "draw": {"poisson": 1}},
    {"setting": "vehicle.parameters.m", "values": [1], "draw": {"normal": [1, 1]}},
    {"levels": 5},
    [],
    None,
)
_SEEDS: tuple[Any, ...] = (
    0,
    -1,
    1.5,
    "many",
    [],
    [1, 1],
    [-1],
    [[1]],
    True,
    float("nan"),
    10**30,
    "1e18",
    [2**63],
    None,
)


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case."""
    runs = 1.0
    campaign: dict[str, Any] = {
        "name": "plan",
        "experiment": "spiral",
        "settings": {"manoeuvre.duration": "2 s"},
        "seeds": 1,
        "filters": ["tukf"],
    }
    kind = rng.choice(("large", "large", "axis", "axis", "seeds", "settings"))
    if kind == "large":
        campaign["seeds"] = int(10 ** rng.uniform(0, 18 if rng.random() < 0.5 else 3))
        runs *= campaign["seeds"]
        campaign["vary"] = []
        for number in range(rng.choice((0, 0, 1, 2, 6))):
            values = [1 + k / 1000 for k in range(rng.choice((2, 10, 1000)))]
            setting = ("identification.prior.factor", "sensors.dvl.rate", "manoeuvre.speed", "sensors.gyroscope.rate")
            setting += ("sensors.attitude.rate", "identification.process_noise.rate")
            campaign["vary"].append({"setting": setting[number], "values": values})
            runs *= len(values)
    elif kind == "axis":
        campaign["vary"] = [rng.choice(_AXES) for _ in range(rng.choice((1, 1, 2)))]
    elif kind == "seeds":
        campaign["seeds"] = rng.choice(_SEEDS)
    else:
        campaign["settings"] |= rng.choice(({"seed": 3}, {"name": "x"}, {"": 1}, {"nowhere": 1}, {"vehicle": 5}))
    (folder / "plan.yaml").write_text(yaml.safe_dump(campaign), encoding="utf-8")
    refused = kind == "settings" or runs > _TOO_MANY
    return Case(f"{kind}: {runs:.3g} runs", (("campaign", "plan.yaml", "--dry-run"),), refused)
