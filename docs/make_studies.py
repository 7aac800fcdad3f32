"""Studies of the accuracy of estimates, into docs/studies.md: `python -m docs.make_studies`.

Each setting is simulated with each seed and identified by every filter. The bounds of other manoeuvres are computed for
each vehicle. Rows are kept; finished seeds are not repeated.
"""

import numpy as np
import pandas as pd

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.errors import SimulationError
from auvid_cli.evaluation.accuracy import average_steady_state_error, coefficient_results, sensor_error_results
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.identifiability import assess_dataset
from auvid_cli.evaluation.innovations import sensor_consistency
from auvid_cli.evaluation.judgement import Grade, Judgement, status_of
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.report.table import filter_label
from auvid_cli.simulation.simulate import simulate
from docs.resumable import EARLIER_SPIRAL, all_rows, asked_seeds
from docs.section import replace_section

_WHITE = "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg}"
_BIASED = "sensors=sensors/table_iii_bias.yaml"
_BIASED_ATTITUDE = (
    "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg, bias_spread: [0.17 deg, 0.17 deg, 1.5 deg]}"
)
_ESTIMATED = "identification.estimate.biases=[gyro, attitude]"
_SETTINGS: dict[str, tuple[str, tuple[str, ...]]] = {
    "vt690, AHRS": ("spiral", ()),
    "vt690, white attitude": ("spiral", (_WHITE,)),
    "REMUS 100, AHRS": ("remus100", ()),
    "REMUS 100, white attitude": ("remus100", (_WHITE,)),
    "vt690, biased sensors, AHRS, biases not estimated": ("spiral", (_BIASED,)),
    "vt690, biased sensors, AHRS, biases estimated": ("spiral", (_BIASED, _ESTIMATED)),
    "vt690, biased sensors, biased attitude, biases not estimated": ("spiral", (_BIASED, _BIASED_ATTITUDE)),
    "vt690, biased sensors, biased attitude, biases estimated": ("spiral", (_BIASED, _BIASED_ATTITUDE, _ESTIMATED)),
}
_VEHICLES = ("spiral", "remus100", "lauv", "lrauv")
_MANOEUVRES = ("zigzag_20_20", "turning_circle", "multisine", "doublets")
_LABELS = ("within 1 %", "within 5 %", "within 20 %", "not identified")


def found(setting: str, seed: int) -> pd.DataFrame:
    """Run all filters on one seed of a setting: a row for each filter."""
    experiment, overrides = _SETTINGS[setting]
    earlier = EARLIER_SPIRAL if experiment == "spiral" else ()
    dataset = simulate(load_experiment(find_experiment(experiment), (f"seed={seed}", *earlier, *overrides)))
    rows, bounds_of = [], BoundsOf(prepare(dataset))
    for name in FilterName:
        estimate = identify(dataset, name)
        bounds = bounds_of(estimate).of_data
        # The judgement decides only which coefficients are identified, and that is not used here.
        results = coefficient_results(estimate, dataset.truth, bounds, Judgement(Grade.UNJUDGED))
        errors = [(row.estimate - row.true) / bounds[row.coefficient] for row in results if row.true is not None]
        row = {
            "filter": estimate.filter,
            "error_percent": average_steady_state_error(results),
            "squared_error_by_bound": np.mean(np.square(errors)),
            "deviation_by_bound": np.median([row.times_bound for row in results if row.times_bound is not None]),
            "status": status_of(estimate).split()[0].rstrip(":"),
            "not_observed": " ".join(row.state for row in sensor_error_results(estimate) if not row.observed),
        }
        rows.append(row | {f"nis_{row.sensor}": row.mean_nis for row in sensor_consistency(estimate)})
    return pd.DataFrame(rows)


def _counts(texts: "pd.Series[str]", form: str) -> str:
    counts = texts.dropna().str.split().explode().value_counts()
    return ", ".join(form.format(text=text, count=count) for text, count in counts.items())


def seed_table(rows: pd.DataFrame) -> list[str]:
    """Return the results of each setting and filter."""
    lines = [
        "| setting | filter | seeds | average error %, mean ± sd | largest | error / bound, RMS | sd / bound, median "
        "| mean NIS | verdicts | not observed (runs) |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- | --- | --- |",
    ]
    for (setting, name), own in rows.groupby(["case", "filter"], sort=False):
        nis = own.filter(like="nis_").mean().dropna()
        verdicts, unseen = _counts(own["status"], "{count} {text}"), _counts(own["not_observed"], "{text} ({count})")
        lines.append(
            f"| {setting} | {filter_label(str(name))} | {len(own)} "
            f"| {own['error_percent'].mean():.3g} ± {own['error_percent'].std():.2g} "
            f"| {own['error_percent'].max():.3g} | {np.sqrt(own['squared_error_by_bound'].mean()):.3g} "
            f"| {own['deviation_by_bound'].median():.3g} "
            f"| {', '.join(f'{str(sensor)[4:]} {value:.3g}' for sensor, value in nis.items())} "
            f"| {verdicts} | {unseen} |"
        )
    return lines


def bounds(case: str, _seed: int) -> pd.DataFrame:
    """Return the bound of each coefficient of a vehicle after a manoeuvre, with white attitude noise."""
    vehicle, manoeuvre = case.split(", ")
    own = load_experiment(find_experiment(vehicle), ())
    overrides = [_WHITE, *(EARLIER_SPIRAL if vehicle == "spiral" else ())]
    if manoeuvre != "spiral":
        speed = f"manoeuvre.speed={own.manoeuvre.speed}"
        overrides += [f"manoeuvre=manoeuvres/{manoeuvre}.yaml", speed, "manoeuvre.duration=300 s"]
    start = {"vehicle": own.vehicle.name, "manoeuvre": manoeuvre}
    try:
        dataset = simulate(load_experiment(find_experiment(vehicle), tuple(overrides)))
    except SimulationError as error:
        return pd.DataFrame([start | {"stopped": str(error).split(";")[0]}])
    found = assess_dataset(dataset).bounds
    return pd.DataFrame(
        [
            start | {"coefficient": bound.coefficient, "percent": bound.percent, "label": bound.label, "stopped": ""}
            for bound in found
        ]
    )


def bounds_table(rows: pd.DataFrame) -> list[str]:
    """Return what each manoeuvre can tell of each vehicle."""
    lines = [
        f"| vehicle | manoeuvre | median bound % | {' | '.join(_LABELS)} | above 5 % |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for (vehicle, manoeuvre), own in rows.groupby(["vehicle", "manoeuvre"], sort=False):
        if own["percent"].isna().all():
            lines.append(f"| {vehicle} | {manoeuvre} | {own['stopped'].iloc[0]} | | | | | |")
            continue
        worst = own[own["percent"] > 5.0].sort_values("percent", ascending=False)
        pairs = zip(worst["coefficient"], worst["percent"], strict=True)
        named = ", ".join(f"{name} {percent:.2g}" for name, percent in pairs).replace("|", r"\|")
        numbers = " | ".join(str((own["label"] == label).sum()) for label in _LABELS)
        lines.append(f"| {vehicle} | {manoeuvre} | {own['percent'].median():.2g} | {numbers} | {named} |")
    return lines


def main() -> None:
    """Run what is missing, and write the tables."""
    seeds = asked_seeds(__doc__, 20)
    cases = [f"{vehicle}, {manoeuvre}" for vehicle in _VEHICLES for manoeuvre in ("spiral", *_MANOEUVRES)]
    of_manoeuvres = all_rows("manoeuvres", [(case, 1) for case in cases], bounds)
    replace_section("manoeuvres", "\n".join(bounds_table(of_manoeuvres)), "studies")
    runs = [(setting, seed) for seed in range(1, seeds + 1) for setting in _SETTINGS]
    replace_section("seeds", "\n".join(seed_table(all_rows("seeds", runs, found))), "studies")


if __name__ == "__main__":
    main()
