"""What a designed run is worth, into docs/studies.md: `python -m docs.make_design`.

Shown by identification, not by the criterion: vehicles that the search has not seen are simulated with the designed run
and with the spiral, equally long, and identified. With the defaults hours; `--vehicles` and `--seeds` ask for less.
"""

import argparse
from itertools import islice, product

import numpy as np

from auvid_cli.api.design import Wish, conclude, designing, searching
from auvid_cli.config.envelope import Envelope
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.filter_name import FilterName
from auvid_cli.config.load import find_experiment, load_experiment
from auvid_cli.config.manoeuvre import AnyManoeuvre
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.design.draws import belief_of_vehicle, drawn_vehicles
from auvid_cli.design.trials import sizes_of
from auvid_cli.identification.identify import identify
from auvid_cli.report.notation import filter_label
from auvid_cli.simulation.simulate import simulate
from docs.section import replace_section

_ATTITUDES = {"white": "sensors.attitude.source=direct", "AHRS": "sensors.attitude.source=ahrs"}
_FILTERS = FilterName.SMOOTHER, FilterName.CKF
# Random stream of the vehicles of this study, apart from all of the design's.
_STREAM = 9


def errors(
    experiment: Experiment, vehicle: VehicleSettings, manoeuvre: AnyManoeuvre, seed: int, name: FilterName
) -> np.ndarray | None:
    """Return the errors of all coefficients, %, or None where the estimator does not come to an end."""
    changes = {"vehicle": vehicle, "manoeuvre": manoeuvre, "seed": seed}
    estimate = identify(simulate(experiment.model_copy(update=changes)), name)
    if not estimate.completed:
        return None
    found, true = estimate.final_coefficients(), vehicle.all_coefficients()
    return 100.0 * np.array([found[symbol] - value for symbol, value in true.items()]) / sizes_of(vehicle)


def rows(name: str, attitude: str, counts: argparse.Namespace) -> list[str]:
    """Find a run for a vehicle, and compare it with its spiral by identification."""
    experiment = load_experiment(find_experiment(name), (_ATTITUDES[attitude],))
    wish = Wish(counts.duration, Envelope(), None, None, (), "D", counts.draws, None)
    with designing(experiment, wish) as task:
        *_, reached = islice(searching(task), counts.generations)
        design = conclude(task, reached)
    manoeuvres = {"spiral": task.space.base, "designed": reached.best.manoeuvre}
    belief = belief_of_vehicle(experiment.vehicle, None)
    vehicles = drawn_vehicles(experiment.vehicle, belief, counts.vehicles, [experiment.seed, _STREAM])
    lines = []
    for filter_name in _FILTERS:
        found = dict[str, list[np.ndarray]]()
        lost = dict[str, int]()
        for kind, manoeuvre in manoeuvres.items():
            runs = [
                errors(experiment, vehicle, manoeuvre, seed, filter_name)
                for vehicle, seed in product(vehicles, range(1, counts.seeds + 1))
            ]
            found[kind] = [run for run in runs if run is not None]
            lost[kind] = len(runs) - len(found[kind])
        sizes = {
            kind: np.exp(np.log(np.sqrt(np.mean(np.square(runs), axis=0))).mean()) if runs else np.nan
            for kind, runs in found.items()
        }
        cells = (
            *(name, attitude, filter_label(filter_name.value), f"{design.gain:.2f}"),
            *(f"{sizes[kind]:.3g}" for kind in manoeuvres),
            f"{sizes['spiral'] / sizes['designed']:.2f}",
            f"{lost['spiral']} / {lost['designed']}",
        )
        lines.append(f"| {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Run everything and write the section."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("experiments", nargs="*", default=["remus100", "lauv"])
    parser.add_argument("--duration", type=float, default=120.0)
    for name, default in (("draws", 8), ("generations", 30), ("vehicles", 8), ("seeds", 20)):
        parser.add_argument(f"--{name}", type=int, default=default)
    counts = parser.parse_args()
    body = [row for name, attitude in product(counts.experiments, _ATTITUDES) for row in rows(name, attitude, counts)]
    lines = [
        f"{counts.vehicles} vehicles that the search has not seen, {counts.seeds} seeds each, {counts.duration:g} s;",
        f"designs of seed 1, {counts.generations} generations about {counts.draws} drawn vehicles. Coefficients are",
        "drawn 30 % about the vehicle file's. Of each the error is its rms over vehicles and seeds; of the 22 the",
        "geometric mean stands here. Promised is the gain by the criterion on 8 further vehicles.",
        "",
        "| vehicle | attitude | estimator | promised | spiral, % | designed, % | gain | not completed |",
        "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |",
        *body,
    ]
    replace_section("design", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
