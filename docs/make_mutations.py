"""Study: are wrongly written logs noticed? Writes docs/studies.md: `python -m docs.make_mutations`, 4 minutes a seed.

One good log is written with 67 errors of signs, units, axes and delays. Each row has two results: whether `import
--suggest` repairs the log; and, with the map of the good log, which checks of `inspect` fail and whether `identify`
calls wrong coefficients sound. Rows are kept; finished errors are not repeated.
"""

import atexit
import re
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import auvid_cli as auvid
from auvid_cli.api.data import suggest_map
from auvid_cli.api.evaluation import judge
from auvid_cli.arrays import wrap
from auvid_cli.config.enums import shipped_configs
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.data.checks import csv_text
from auvid_cli.data.dataset import Dataset
from auvid_cli.errors import AuvidError
from auvid_cli.vehicle.parameters import SENSORS
from auvid_cli.vehicle.rigid_body import GRAVITY, body_to_earth
from docs.resumable import WIDE_PRIOR, all_rows, asked_seeds
from docs.section import replace_section

Columns = dict[str, NDArray[np.float64]]
Mutation = Callable[[Columns], Columns]

# Standard deviations beyond which a coefficient is wrong; share of its own spread within which a signal is restored.
_WRONG, _RESTORED = 5.0, 0.3
# What stands before that which an inspection only notes.
_NOTED = "noted: "
_LOGGED = ("gyroscope", "accelerometer", "dvl", "attitude", "depth")
_RUN = (
    "manoeuvre={type: multisine, duration: 60 s, speed: 2 m/s, autopilot: {bandwidth: 0.5}, input_rate: 10 Hz, "
    "excitation: {rudder: {amplitude: 20 deg, lowest: 0.05 Hz, highest: 0.5 Hz, lines: 9}, "
    "elevator: {amplitude: 15 deg, lowest: 0.1 Hz, highest: 0.6 Hz, lines: 9, phase: 60 deg}, "
    "surge_force: {amplitude: 15 N, lowest: 0.02 Hz, highest: 0.2 Hz, lines: 5, phase: 120 deg}}}",
    "sensors.gyroscope.rate=10 Hz",
    "sensors.accelerometer.rate=10 Hz",
    "sensors.dvl={rate: 10 Hz, noise: 5 mm/s}",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.depth={rate: 10 Hz, noise: 1 cm}",
    "identification.integration_step=0.05 s",
)


def _turned(*names: str, factor: float = -1.0, offset: float = 0.0) -> Mutation:
    return lambda log: log | {name: factor * log[name] + offset for name in names}


def _late(*names: str, seconds: float) -> Mutation:
    return lambda log: log | {name: np.interp(log["t"] - seconds, log["t"], log[name]) for name in names}


def _over_ground(log: Columns) -> Columns:
    angles, velocity = (np.column_stack([log[name] for name in names]) for names in (("phi", "theta", "psi"), "uvw"))
    return log | dict(zip("uvw", body_to_earth(angles, velocity).T, strict=True))


_ANGLES, _RATES, _FORCE, _VELOCITY = ("phi", "theta", "psi"), ("p", "q", "r"), ("fx", "fy", "fz"), ("u", "v", "w")
_DEGREE, _KNOT, _FOOT = 180.0 / np.pi, 1852.0 / 3600.0, 0.3048
SINGLE: dict[str, Mutation] = {
    "rudder reversed": _turned("rudder"),
    "elevator reversed": _turned("elevator"),
    "fins exchanged": lambda log: log | {"rudder": log["elevator"], "elevator": log["rudder"]},
    "fins in degrees": _turned("rudder", "elevator", factor=_DEGREE),
    "fins half as large": _turned("rudder", "elevator", factor=0.5),
    "inputs 0.1 s late": _late("rudder", "elevator", "surge_force", seconds=0.1),
    "inputs 0.3 s late": _late("rudder", "elevator", "surge_force", seconds=0.3),
    "inputs 1 s late": _late("rudder", "elevator", "surge_force", seconds=1.0),
    "rudder trim of 2 deg": _turned("rudder", factor=1.0, offset=2.0 / _DEGREE),
    "gyroscope FLU": _turned("q", "r"),
    "p reversed": _turned("p"),
    "q reversed": _turned("q"),
    "r reversed": _turned("r"),
    "gyroscope in degrees": _turned(*_RATES, factor=_DEGREE),
    "gyroscope 0.2 s late": _late(*_RATES, seconds=0.2),
    "gyroscope biased by 1 deg/s": _turned("r", factor=1.0, offset=1.0 / _DEGREE),
    "attitude in degrees": _turned(*_ANGLES, factor=_DEGREE),
    "attitude FLU from ENU": lambda log: _turned("psi", offset=np.pi / 2)(_turned("theta")(log)),
    "heading ENU": _turned("psi", offset=np.pi / 2),
    "heading reversed": _turned("psi"),
    "theta reversed": _turned("theta"),
    "phi reversed": _turned("phi"),
    "attitude 0.3 s late": _late(*_ANGLES, seconds=0.3),
    "upside down": lambda log: log | {"phi": np.mod(log["phi"], 2 * np.pi) - np.pi},
    "depth as height": _turned("down"),
    "depth in mm": _turned("down", factor=1000.0),
    "depth in feet": _turned("down", factor=1 / _FOOT),
    "depth 0.5 s late": _late("down", seconds=0.5),
    "knots": _turned(*_VELOCITY, factor=1 / _KNOT),
    "mm/s": _turned(*_VELOCITY, factor=1000.0),
    "DVL FLU": _turned("v", "w"),
    "u reversed": _turned("u"),
    "v reversed": _turned("v"),
    "w reversed": _turned("w"),
    "DVL NED": _over_ground,
    "DVL 0.3 s late": _late(*_VELOCITY, seconds=0.3),
    "DVL 2 % too fast": _turned(*_VELOCITY, factor=1.02),
    "accelerometer FLU": _turned("fy", "fz"),
    "fx reversed": _turned("fx"),
    "g": _turned(*_FORCE, factor=1 / GRAVITY),
    "all mirrored": _turned("v", "p", "r", "phi", "psi", "fy", "rudder"),
    "all but the fins mirrored": _turned("v", "p", "r", "phi", "psi", "fy"),
}
PAIRS = (
    ("rudder reversed", "r reversed"),
    ("rudder reversed", "elevator reversed"),
    ("rudder reversed", "heading reversed"),
    ("fins exchanged", "rudder reversed"),
    ("fins exchanged", "inputs 1 s late"),
    ("fins in degrees", "gyroscope in degrees"),
    ("gyroscope FLU", "gyroscope in degrees"),
    ("gyroscope FLU", "DVL FLU"),
    ("r reversed", "heading reversed"),
    ("q reversed", "theta reversed"),
    ("attitude in degrees", "q reversed"),
    ("attitude FLU from ENU", "DVL NED"),
    ("heading ENU", "DVL FLU"),
    ("heading ENU", "rudder reversed"),
    ("heading reversed", "v reversed"),
    ("theta reversed", "w reversed"),
    ("heading ENU", "accelerometer FLU"),
    ("depth in mm", "knots"),
    ("depth in feet", "knots"),
    ("depth as height", "theta reversed"),
    ("upside down", "gyroscope FLU"),
    ("inputs 0.3 s late", "DVL 0.3 s late"),
    ("attitude 0.3 s late", "gyroscope 0.2 s late"),
    ("DVL 2 % too fast", "inputs 0.1 s late"),
    ("gyroscope 0.2 s late", "rudder trim of 2 deg"),
)


@dataclass(frozen=True)
class Outcome:
    """Result of a log: whether a suggested map restores it, and the verdicts with the map of the good log.

    Attributes
    ----------
    restored : bool
    named : str
        What an import or an inspection fails, or else what it notes and does not of the good log; empty if nothing.
    grade : str
    sigmas : float or None
        Error of the worst coefficient; None if nothing was estimated.
    """

    restored: bool
    named: str
    grade: str
    sigmas: float | None


class GoodLog:
    """A simulated run, its columns in SI, and what is known of it."""

    def __init__(self, seed: int, folder: Path) -> None:
        experiment = auvid.load_experiment("spiral", WIDE_PRIOR, f"seed={seed}", *_RUN)
        self._dataset, self._folder = auvid.simulate(experiment), folder
        self.true = experiment.vehicle.all_coefficients()
        sensors = self._dataset.sensors
        time = sensors["dvl"].time[1:-1]
        self.columns: Columns = {"t": time}
        for name in _LOGGED:
            record = sensors[name]
            for quantity, values in zip(SENSORS[name], record.values.T, strict=True):
                self.columns[quantity.symbol] = values[np.searchsorted(record.time, time - 1e-3)]
        inputs = self._dataset.inputs
        held = np.searchsorted(inputs.time, time + 1e-3, side="right") - 1
        for name, values in zip(("rudder", "elevator", "surge_force"), inputs.values.T, strict=False):
            self.columns[name] = values[held]
        self._map = self.suggested(self.columns)
        self._usual = frozenset(_doubts(self.imported(self._map)))

    def suggested(self, columns: Columns) -> str:
        """Write a log, and fill in what only its owner knows of the suggested map."""
        log = self._folder / "dive.csv"
        log.write_text(csv_text([*columns], np.column_stack([*columns.values()]).tolist()), encoding="utf-8")
        text = suggest_map([log], self._folder)
        vehicle = shipped_configs() / "vehicles" / "vt690.yaml"
        text = re.sub(r"(?s)vehicle: ?#?.*?\nlogs:", f"vehicle: {vehicle}\nlogs:", text)
        for name in _LOGGED:
            deviation = self._dataset.sensors[name].standard_deviation.tolist()
            pattern = rf"(?s)(\n  {name}:.*?standard_deviation: )(?:null|estimate)[^\n]*"
            text = re.sub(pattern, lambda found, d=deviation: f"{found[1]}{d}", text, count=1)
        return text

    def imported(self, text: str) -> Dataset:
        """Read the log that was written last by a map, and the settings to identify with."""
        path = self._folder / "map.yaml"
        path.write_text(text, encoding="utf-8")
        dataset = auvid.import_logs(path)
        settings = dump_experiment(dataset.experiment)
        return replace(dataset, experiment=parse_run(settings, "dive", ["identification.integration_step=0.05 s"]))

    def is_restored(self, dataset: Dataset) -> bool:
        """Whether a dataset has the signals of the good log."""
        time = self.columns["t"] - self.columns["t"][0]
        found = {
            quantity.symbol: np.interp(time, record.time, np.unwrap(values) if quantity.unit == "rad" else values)
            for name, record in dataset.sensors.items()
            for quantity, values in zip(SENSORS[name], record.values.T, strict=True)
        }
        inputs = dataset.inputs
        found |= {
            name: values[np.maximum(np.searchsorted(inputs.time, time + 1e-3, side="right") - 1, 0)]
            for name, values in zip(("rudder", "elevator"), inputs.values.T, strict=False)
        }
        inside = slice(20, -20)
        for symbol in self.columns.keys() - {"t", "surge_force"}:
            if symbol not in found:
                return False
            error = (found[symbol] - self.columns[symbol])[inside]
            if symbol in ("phi", "psi"):
                error = wrap(error)
            if not np.sqrt(np.mean(np.square(error))) < _RESTORED * np.std(self.columns[symbol]):
                return False
        return True

    def outcome(self, names: tuple[str, ...]) -> Outcome:
        """Write the log otherwise, and go through it."""
        columns = self.columns
        for name in names:
            columns = SINGLE[name](columns)
        text = self.suggested(columns)
        try:
            restored = self.is_restored(self.imported(text))
        except AuvidError:
            restored = False
        try:
            dataset = self.imported(self._map)
            doubts = {name: fails for name, fails in _doubts(dataset).items() if name not in self._usual}
            failed, noted = (", ".join(name for name in doubts if doubts[name] is each) for each in (True, False))
            return Outcome(restored, failed or (noted and f"{_NOTED}{noted}"), *self._judged(dataset))
        except AuvidError as error:
            # Without the folder, which differs between machines.
            return Outcome(restored, "refused: " + str(error).splitlines()[0].partition("map.yaml:")[2], "-", None)

    def _judged(self, dataset: Dataset) -> tuple[str, float | None]:
        estimate = auvid.identify(dataset, "smoother")
        grade = judge(estimate)["smoother"].grade.value
        if not estimate.completed:
            return grade, None
        found, deviations = estimate.final_coefficients(), estimate.final_deviations()
        return grade, max(abs(found[symbol] - self.true[symbol]) / deviations[symbol] for symbol in self.true)


def _doubts(dataset: Dataset) -> dict[str, bool]:
    """Name what an inspection does not pass, and whether it fails it."""
    checks = (check for check in auvid.inspect(dataset).checks if not check.passed)
    return {f"{check.subject}: {check.check}": check.passed is False for check in checks}


CASES: dict[str, tuple[str, ...]] = {"as it is": ()}
CASES |= {" and ".join(names): names for names in (*((name,) for name in SINGLE), *PAIRS)}


@cache
def good_log(seed: int) -> GoodLog:
    """Return the good log of a seed, in a folder that is there as long as this program."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return GoodLog(seed, Path(folder.name))


def found(case: str, seed: int) -> pd.DataFrame:
    """Go through one way to write it: a row."""
    return pd.DataFrame([asdict(good_log(seed).outcome(CASES[case]))])


def _line(row: pd.Series) -> str:
    off, named = "" if np.isnan(row["sigmas"]) else f"{row['sigmas']:.3g}", row["named"].replace("|", r"\|")
    short = named if len(named) <= 100 else f"{named[:97]}..."
    return f"| {row['case']} | {'yes' if row['restored'] else 'no'} | {short} | {row['grade']} | {off} |"


def _summary(rows: pd.DataFrame) -> str:
    mutated = rows[rows["case"] != "as it is"]
    wrong = mutated[mutated["sigmas"].isna() | (mutated["sigmas"] > _WRONG)]
    named, noted = wrong["named"] != "", wrong["named"].str.startswith(_NOTED)
    sound = (wrong["grade"] == "sound") & wrong["sigmas"].notna()
    unseen = mutated[~mutated["restored"] & (mutated["named"] == "")]
    return (
        f"`--suggest` repairs {mutated['restored'].sum()} of {len(mutated)} errors. With the map of the good log, "
        f"{len(wrong)} give no estimate or a wrong one. Of these, refused or FAIL: {(named & ~noted).sum()}; only "
        f"noted: {noted.sum()}; called sound by `identify`: {sound.sum()}. Neither repaired nor named: {len(unseen)}."
    )


def main() -> None:
    """Go through all of them and write the section."""
    seeds = asked_seeds(__doc__, 1)
    runs = [(case, seed) for seed in range(1, seeds + 1) for case in CASES]
    rows = all_rows("mutations", runs, found).fillna({"named": ""})
    rows = rows.sort_values("case", key=lambda cases: cases.map([*CASES].index), kind="stable")
    shown = rows[rows["seed"] == 1]
    lines = [
        *(f"Seed {seed}. {_summary(own)}\n" for seed, own in rows.groupby("seed")),
        "Of seed 1:",
        "",
        "| error | repaired | named, with the map of the good log | judged | largest error / sd |",
        "| --- | --- | --- | --- | ---: |",
        *(_line(row) for _, row in shown.iterrows()),
    ]
    replace_section("mutations", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
