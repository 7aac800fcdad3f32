"""Study: value of a designed run. Writes docs/studies.md: `python -m docs.make_design`, 10 minutes and 10 a seed.

Shown by identification, not by the criterion: vehicles that the search has not seen are simulated with the designed run
and with the spiral, equally long, and identified with three sets of sensors. One run is designed for each vehicle, with
the sensors that its experiment has. Rows are kept; finished runs are not repeated.
"""

from collections.abc import Iterator
from itertools import islice
from time import monotonic

import numpy as np
import pandas as pd
import yaml
from pydantic import TypeAdapter

from auvid_cli.api.design import Requirement, conclude, designing, searching
from auvid_cli.config.enums import FilterName
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.design.mission import manoeuvre_yaml
from auvid_cli.design.problem import distribution_from_vehicle, draw_vehicles
from auvid_cli.design.trials import sizes_of
from auvid_cli.identification.run import identify
from auvid_cli.report.table import filter_label
from auvid_cli.simulation.simulate import simulate
from docs.resumable import EARLIER_SPIRAL, all_rows, asked_seeds, seed_range
from docs.section import replace_section

_EXPERIMENTS = "remus100", "lauv", "spiral", "lrauv"
_SENSORS = {
    "AHRS": (),
    "white": ("sensors.attitude.source=direct",),
    "raw": (
        "sensors=sensors/table_iii_bias.yaml",
        "identification.attitude_from=inertial",
        "identification.estimate.biases=[gyro, accelerometer, magnetometer]",
    ),
}
_FILTERS = FilterName.SMOOTHER, FilterName.CKF
_DURATION, _DRAWS, _GENERATIONS, _VEHICLES = 120.0, 8, 30, 8
# Random stream of the vehicles of this study, apart from all of the design's.
_STREAM = 9
_TEXT = f"""\
{_VEHICLES} vehicles that the search has not used, {{seeds}}, {_DURATION:g} s. One run is designed for
each experiment, with an AHRS and seed 1, in {_GENERATIONS} generations ({{evaluations}} manoeuvres) for {_DRAWS} drawn
vehicles: {{minutes}} minutes each, on a busy machine. Coefficients of a drawn vehicle differ from the vehicle file by
30 % (standard deviation). The columns in % are the geometric mean over coefficients of the RMS error over vehicles and
seeds. Promised: gain of the criterion, on 8 further vehicles. Of a vehicle: smallest and largest gain. Not completed:
runs with the spiral / with the designed run.
"""
_MANOEUVRE: TypeAdapter[AnyManoeuvre] = TypeAdapter(AnyManoeuvre)


def _experiment(name: str, *overrides: str) -> Experiment:
    earlier = EARLIER_SPIRAL if name == "spiral" else ()
    return load_experiment(find_experiment(name), (*earlier, *overrides))


def design(name: str, seed: int) -> pd.DataFrame:
    """Find a run for a vehicle: a row for it, and one for the spiral."""
    experiment = _experiment(name, f"seed={seed}")
    start, wish = monotonic(), Requirement(_DURATION, Envelope(), None, None, (), "D", _DRAWS, None)
    with designing(experiment, wish) as task:
        *_, reached = islice(searching(task), _GENERATIONS)
        minutes, found = (monotonic() - start) / 60.0, conclude(task, reached)
    kinds = {"spiral": task.space.base, "designed": reached.best.manoeuvre}
    promised = found.trials["designed"].mean_gain_over(found.trials["spiral"])
    kept = {"promised": promised, "chosen": found.chosen, "outside": reached.best.n_outside, "minutes": minutes}
    return pd.DataFrame(
        [
            {"kind": kind, "manoeuvre": manoeuvre_yaml(manoeuvre, kind), "evaluations": reached.evaluations} | kept
            for kind, manoeuvre in kinds.items()
        ]
    )


class Fleet:
    """Vehicles that no search has seen, and the manoeuvres that they sail."""

    def __init__(self, designs: pd.DataFrame) -> None:
        self._manoeuvres = {
            (str(row["case"]), str(row["kind"])): _MANOEUVRE.validate_python(yaml.safe_load(str(row["manoeuvre"])))
            for _, row in designs.iterrows()
        }

    def errors(self, case: str, seed: int) -> pd.DataFrame:
        """Identify one vehicle with one seed, which count together, by each estimator: errors, %, and whether it ended.

        Parameters
        ----------
        case : str
            Experiment, sensors, and which manoeuvre.
        seed : int
            From 0: vehicle by vehicle, then the next seed.
        """
        name, sensors, kind = case.split(", ")
        experiment = _experiment(name, *_SENSORS[sensors])
        vehicle = _vehicles(experiment)[seed % _VEHICLES]
        changes = {"vehicle": vehicle, "manoeuvre": self._manoeuvres[name, kind], "seed": 1 + seed // _VEHICLES}
        dataset = simulate(experiment.model_copy(update=changes))
        true, rows = vehicle.all_coefficients(), list[pd.DataFrame]()
        for filter_name in _FILTERS:
            estimate = identify(dataset, filter_name)
            found = estimate.final_coefficients()
            percent = 100.0 * np.array([found[symbol] - value for symbol, value in true.items()]) / sizes_of(vehicle)
            own = {"filter": filter_name.value, "symbol": list(true), "error": percent}
            rows.append(pd.DataFrame({**own, "completed": estimate.completed}))
        return pd.concat(rows)


def _vehicles(experiment: Experiment) -> list[VehicleSettings]:
    belief = distribution_from_vehicle(experiment.vehicle, None)
    return list(draw_vehicles(experiment.vehicle, belief, _VEHICLES, [experiment.seed, _STREAM]))


def sizes(rows: pd.DataFrame) -> float:
    """Return the geometric mean over coefficients of the rms error over vehicles and seeds, %."""
    squares = rows.assign(square=rows["error"] ** 2).groupby("symbol")["square"].mean()
    return float(np.exp(0.5 * np.log(squares).mean()))


def _lines(rows: pd.DataFrame, designs: pd.DataFrame) -> Iterator[str]:
    """Yield the table's lines: experiment by experiment, sensors, estimator."""
    split = rows["case"].str.split(", ", expand=True).set_axis(["name", "sensors", "kind"], axis=1)
    rows = rows.join(split)
    for name in _EXPERIMENTS:
        for sensors in _SENSORS:
            for filter_name in _FILTERS:
                here = (rows["name"] == name) & (rows["sensors"] == sensors) & (rows["filter"] == filter_name.value)
                runs = {kind: rows[here & (rows["kind"] == kind)] for kind in ("spiral", "designed")}
                if any(each.empty for each in runs.values()):
                    continue
                ended = {kind: each[each["completed"]] for kind, each in runs.items()}
                error = {kind: sizes(each) for kind, each in ended.items()}
                by_vehicle = {
                    kind: pd.Series({k: sizes(own) for k, own in each.groupby(each["seed"] % _VEHICLES)})
                    for kind, each in ended.items()
                }
                gains = by_vehicle["spiral"] / by_vehicle["designed"]
                lost = {kind: runs[kind]["seed"].nunique() - each["seed"].nunique() for kind, each in ended.items()}
                promised = designs.loc[designs["case"] == name, "promised"].iloc[0]
                cells = (
                    *(name, sensors, filter_label(filter_name.value), f"{promised:.2f}"),
                    *(f"{error[kind]:.3g}" for kind in runs),
                    f"{error['spiral'] / error['designed']:.2f}",
                    f"{gains.min():.2f} - {gains.max():.2f}",
                    f"{lost['spiral']} / {lost['designed']}",
                )
                yield f"| {' | '.join(cells)} |"


def main() -> None:
    """Run everything and write the section."""
    seeds = asked_seeds(__doc__, 20)
    designs = all_rows("design_runs", [(name, 1) for name in _EXPERIMENTS], design)
    cases = [
        f"{name}, {sensors}, {kind}" for name in _EXPERIMENTS for sensors in _SENSORS for kind in ("spiral", "designed")
    ]
    runs = [(case, seed) for seed in range(_VEHICLES * seeds) for case in cases]
    rows = all_rows("design", runs, Fleet(designs).errors)
    minutes = designs["minutes"]
    text = _TEXT.format(
        seeds=seed_range(1 + rows["seed"] // _VEHICLES),
        evaluations=designs["evaluations"].iloc[0],
        minutes=f"{minutes.min():.1f} to {minutes.max():.1f}",
    )
    columns = "experiment", "sensors", "estimator", "promised", "spiral, %", "designed, %", "gain", "of a vehicle"
    head = f"| {' | '.join((*columns, 'not completed'))} |", f"| --- | --- | --- {'| ---: ' * 6}|"
    replace_section("design", "\n".join([text, *head, *_lines(rows, designs)]), "studies")


if __name__ == "__main__":
    main()
