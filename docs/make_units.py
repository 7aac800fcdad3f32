"""Units that `import --suggest` finds in logs without units, into docs/studies.md: `python -m docs.make_units`.

Each simulated run is written with and without DVL and AHRS, and with rates and angles in rad or deg. Rows are kept;
finished runs are not repeated.
"""

import tempfile
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

import auvid_cli as auvid
from auvid_cli.api.data import suggest_map
from auvid_cli.data.checks import csv_text
from auvid_cli.vehicle.parameters import SENSORS
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

_MANOEUVRES = {
    "vt690": ("doublets", "zigzag_20_20", "spiral"),
    "remus100": ("spiral_remus100",),
    "lauv": ("doublets", "spiral_lauv"),
    "lrauv": ("doublets", "spiral_lrauv"),
    "dive": ("doublets", "zigzag_10_10"),
}
_RUN = (
    "sensors.gyroscope.rate=10 Hz",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.depth={rate: 10 Hz, noise: 1 cm}",
)
# Headings of the columns, by symbol.
_HEADINGS = {
    **{"p": "gyro_x", "q": "gyro_y", "r": "gyro_z", "u": "dvl_u", "v": "dvl_v", "w": "dvl_w"},
    **{"phi": "roll", "theta": "pitch", "psi": "heading", "down": "depth"},
}
_UNITS = {"gyroscope": ("rad/s", "deg/s"), "attitude": ("rad", "deg"), "dvl": ("m/s",) * 2, "depth": ("m",) * 2}


def logged(dataset: "auvid.Dataset", dvl: bool, ahrs: bool, rates_in_deg: bool, angles_in_deg: bool) -> str:
    """Return a log as CSV text at the times of the gyroscope, without units."""
    factors = {"rad/s": np.degrees(1.0) if rates_in_deg else 1.0, "rad": np.degrees(1.0) if angles_in_deg else 1.0}
    present = ["gyroscope", "depth", *["dvl"] * dvl, *["attitude"] * ahrs]
    time = dataset.sensors["gyroscope"].time
    columns = {"time": time}
    for name in present:
        record = dataset.sensors[name]
        rows = np.searchsorted(record.time, time + 1e-6, side="right") - 1
        for quantity, values in zip(SENSORS[name], record.values.T, strict=True):
            numbers = factors.get(quantity.unit, 1.0) * values
            columns[_HEADINGS[quantity.symbol]] = np.where(rows >= 0, numbers[rows], np.nan)
    inputs = dataset.inputs
    held = np.maximum(np.searchsorted(inputs.time, time + 1e-6, side="right") - 1, 0)
    for name, values in zip(("rudder", "elevator"), inputs.values.T, strict=False):
        columns[name] = factors["rad"] * values[held]
    return csv_text([*columns], np.column_stack([*columns.values()]).tolist())


def verdicts(text: str, rates_in_deg: bool, angles_in_deg: bool) -> dict[str, int | str]:
    """Return the numbers of right, wrong and asked units of a suggested map, and which are wrong or asked."""
    found = yaml.safe_load(text)
    truth = {name: units[rates_in_deg if name == "gyroscope" else angles_in_deg] for name, units in _UNITS.items()}
    units = {name: (sensor["unit"], truth[name]) for name, sensor in found["sensors"].items()}
    for fin in ("rudder", "elevator"):
        units[fin] = found["inputs"][fin]["unit"], truth["attitude"]
    counts = {"right": 0, "wrong": 0, "question": 0}
    for unit, true in units.values():
        counts["question" if unit is None else "right" if unit == true else "wrong"] += 1
    return counts | {
        "which": " ".join(f"{name}={unit}" for name, (unit, true) in units.items() if unit not in (true, None)),
        "asked": " ".join(name for name, (unit, _) in units.items() if unit is None),
    }


def found(vehicle: str, seed: int) -> pd.DataFrame:
    """Simulate a run, write it in all ways, and return a row for each."""
    manoeuvre = _MANOEUVRES[vehicle][seed % len(_MANOEUVRES[vehicle])]
    dataset = auvid.simulate(
        auvid.load_experiment(
            "remus100" if vehicle == "remus100" else "spiral",
            f"vehicle=vehicles/{vehicle}.yaml",
            f"manoeuvre=manoeuvres/{manoeuvre}.yaml",
            f"seed={seed}",
            *_RUN,
        )
    )
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "dive.csv"
        for dvl, ahrs, rates, angles in product((True, False), repeat=4):
            log.write_text(logged(dataset, dvl, ahrs, rates, angles), encoding="utf-8")
            row = {"dvl": dvl, "ahrs": ahrs, "rates_in_deg": rates, "angles_in_deg": angles, "manoeuvre": manoeuvre}
            rows.append(row | verdicts(suggest_map([log], Path(folder)), rates, angles))
    return pd.DataFrame(rows)


def main() -> None:
    """Go through all runs and write the section."""
    seeds = asked_seeds(__doc__, 7)
    rows = all_rows("units", [(vehicle, seed) for seed in range(1, seeds + 1) for vehicle in _MANOEUVRES], found)
    total = rows[["right", "wrong", "question"]].sum()
    logs = f"{int((rows['wrong'] > 0).sum())} of {len(rows)} logs have a wrong unit"
    lines = [
        f"{logs}. Of {int(total.sum())} units {total['question'] / total.sum():.1%} are questions.",
        "",
        "| DVL | AHRS | logs | right | wrong | questions |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    for (dvl, ahrs), own in rows.groupby(["dvl", "ahrs"], sort=False):
        counts = " | ".join(str(int(own[name].sum())) for name in ("right", "wrong", "question"))
        lines.append(f"| {'yes' if dvl else 'no'} | {'yes' if ahrs else 'no'} | {len(own)} | {counts} |")
    replace_section("units", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
