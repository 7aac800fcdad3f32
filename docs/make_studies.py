"""Studies of the accuracy of estimates: `python -m docs.make_studies`, some twenty minutes on two cores.

Twenty seeds of each setting for every filter, and what other manoeuvres can say of each vehicle; writes
`docs/studies.md`.
"""

import argparse
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.errors import SimulationError
from auvid_cli.evaluation.accuracy import average_steady_state_error, coefficient_results, sensor_error_results
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.evaluation.innovations import sensor_consistency, status_of
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.report.table import filter_label
from auvid_cli.simulation.simulate import simulate
from docs.resumable import EARLIER_SPIRAL
from docs.section import replace_section

_WHITE = "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg}"
_BIASED = "sensors=sensors/table_iii_bias.yaml"
_BIASED_ATTITUDE = (
    "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg, bias_spread: [0.17 deg, 0.17 deg, 1.5 deg]}"
)
_BLOCKS = "identification.estimate.biases=[gyro, attitude]"
_SETTINGS: dict[str, tuple[str, tuple[str, ...]]] = {
    "vt690, AHRS": ("spiral", ()),
    "vt690, white attitude": ("spiral", (_WHITE,)),
    "REMUS 100, AHRS": ("remus100", ()),
    "REMUS 100, white attitude": ("remus100", (_WHITE,)),
    "vt690, biased sensors, AHRS, no blocks": ("spiral", (_BIASED,)),
    "vt690, biased sensors, AHRS, blocks": ("spiral", (_BIASED, _BLOCKS)),
    "vt690, biased sensors, biased attitude, no blocks": ("spiral", (_BIASED, _BIASED_ATTITUDE)),
    "vt690, biased sensors, biased attitude, blocks": ("spiral", (_BIASED, _BIASED_ATTITUDE, _BLOCKS)),
}
_VEHICLES = ("spiral", "remus100", "lauv", "lrauv")
_MANOEUVRES = ("zigzag_20_20", "turning_circle", "multisine", "doublets")


class Outcome(NamedTuple):
    """One filter on one seed: average error in percent, errors and standard deviations over the bound, and so on."""

    filter: str
    average_error: float | None
    errors: list[float]
    deviations: list[float]
    nis: dict[str, float]
    status: str
    unobserved: list[str]


def outcomes(job: tuple[str, int]) -> list[Outcome]:
    """Run all filters on one seed of a setting."""
    setting, seed = job
    experiment, overrides = _SETTINGS[setting]
    earlier = EARLIER_SPIRAL if experiment == "spiral" else ()
    dataset = simulate(load_experiment(find_experiment(experiment), (f"seed={seed}", *earlier, *overrides)))
    by_filter, bounds_of = [], BoundsOf(prepare(dataset))
    for name in FilterName:
        estimate = identify(dataset, name)
        bounds = bounds_of(estimate).of_data
        # Whether a coefficient counts as identified is nothing that is said here.
        results = coefficient_results(estimate, dataset.truth, bounds, Judgement(Grade.UNJUDGED))
        by_filter.append(
            Outcome(
                estimate.filter,
                average_steady_state_error(results),
                [(row.estimate - row.true) / bounds[row.coefficient] for row in results if row.true is not None],
                [row.times_bound for row in results if row.times_bound is not None],
                {row.sensor: row.mean_nis for row in sensor_consistency(estimate)},
                status_of(estimate).split()[0].rstrip(":"),
                [row.state for row in sensor_error_results(estimate) if not row.observed],
            )
        )
    return by_filter


def _seed_rows(setting: str, runs: Iterable[list[Outcome]]) -> list[str]:
    rows = []
    for of_filter in zip(*runs, strict=True):
        errors = [one.average_error for one in of_filter if one.average_error is not None]
        sensors = of_filter[0].nis
        nis = ", ".join(f"{sensor} {np.mean([one.nis[sensor] for one in of_filter]):.3g}" for sensor in sensors)
        said = ", ".join(f"{count} {text}" for text, count in Counter(one.status for one in of_filter).most_common())
        unseen = ", ".join(f"{s} ({n})" for s, n in Counter(s for one in of_filter for s in one.unobserved).items())
        efficiency = np.sqrt(np.mean(np.square([one.errors for one in of_filter])))
        claimed = np.median(np.concatenate([one.deviations for one in of_filter]))
        rows.append(
            f"| {setting} | {filter_label(of_filter[0].filter)} | {np.mean(errors):.3g} ± {np.std(errors):.2g} | "
            f"{max(errors):.3g} | {efficiency:.3g} | {claimed:.3g} | {nis} | {said} | {unseen} |"
        )
    return rows


def manoeuvre_row(job: tuple[str, str]) -> str:
    """Put into a row what a manoeuvre says of a vehicle, with white attitude noise."""
    vehicle, manoeuvre = job
    own = load_experiment(find_experiment(vehicle), ())
    overrides = [_WHITE, *(EARLIER_SPIRAL if vehicle == "spiral" else ())]
    if manoeuvre != "spiral":
        speed = f"manoeuvre.speed={own.manoeuvre.speed}"
        overrides += [f"manoeuvre=manoeuvres/{manoeuvre}.yaml", speed, "manoeuvre.duration=300 s"]
    start = f"| {own.vehicle.name} | {manoeuvre} |"
    try:
        identifiability = assess_dataset(simulate(load_experiment(find_experiment(vehicle), tuple(overrides))))
    except SimulationError as error:
        return f"{start} {str(error).split(';')[0]} | | | | | |"
    counts = Counter(bound.label for bound in identifiability.bounds)
    worst = sorted((b for b in identifiability.bounds if b.percent > 5.0), key=lambda b: -b.percent)
    named = ", ".join(rf"{b.coefficient} {b.percent:.2g}".replace("|", r"\|") for b in worst)
    numbers = [f"{counts[label]}" for label in ("within 1 %", "within 5 %", "within 20 %", "not identified")]
    median = np.median([bound.percent for bound in identifiability.bounds])
    return f"{start} {median:.2g} | {' | '.join(numbers)} | {named} |"


def main() -> None:
    """Run everything and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    with ProcessPoolExecutor() as workers:
        jobs = [(vehicle, manoeuvre) for vehicle in _VEHICLES for manoeuvre in ("spiral", *_MANOEUVRES)]
        manoeuvres = list(workers.map(manoeuvre_row, jobs))
        rows = []
        for setting in _SETTINGS:
            runs = workers.map(outcomes, [(setting, seed) for seed in range(1, options.seeds + 1)])
            rows += _seed_rows(setting, runs)
    seeds = [
        f"{options.seeds} seeds each, 300 s.",
        "",
        "| setting | filter | average error %, mean ± sd | largest | error / bound, RMS | sd / bound, median "
        "| mean NIS | verdicts | not observed (runs) |",
        "| --- | --- | ---: | ---: | ---: | ---: | --- | --- | --- |",
        *rows,
    ]
    bounds = [
        "| vehicle | manoeuvre | median bound % | within 1 % | within 5 % | within 20 % | not identified | above 5 % |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- |",
        *manoeuvres,
    ]
    replace_section("seeds", "\n".join(seeds), "studies")
    replace_section("manoeuvres", "\n".join(bounds), "studies")


if __name__ == "__main__":
    main()
