"""Study: `auvid fit` on field logs over seeds, next to settings by hand: `python -m docs.make_field_fit`.

Each seed has a survey, a disturbance and a vehicle file of its own. Both models are of the first 320 s, and predict
the turns of the rest. A seed takes some ten minutes; rows are kept, and finished seeds are not repeated.
"""

import tempfile
from pathlib import Path
from time import process_time

import pandas as pd

import auvid_cli as auvid
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.estimate import Estimate
from auvid_cli.simulation.field_log import field_log
from docs.make_field import tuned_survey, with_settings
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

_SEEN, _UNSEEN = "identification.use.spans=[[0, 320]]", "identification.use.spans=[[321, null]]"
_SIGNALS = {"r": "yaw rate", "v": "sway"}
_WRONG = 5.0  # standard deviations
_MARGIN = 1.1  # ratio of the errors of fit to those by hand


def _errors(estimate: Estimate, survey: Dataset, name: str) -> dict[str, float | None]:
    """Return the errors of a model and of the vehicle file in unseen turns 20 s ahead, SI."""
    if not estimate.completed:
        return {}
    validation = auvid.validate(with_settings(survey, _UNSEEN), estimate)
    rows = [row for row in validation.predictions if row.kind == "ahead_in_turns" and row.horizon_s == 20.0]
    by_signal = {row.signal: row for row in rows if row.signal in _SIGNALS}
    errors = {f"{name}_{signal}": row.rmse for signal, row in by_signal.items()}
    return errors | {f"file_{signal}": row.vehicle_file_rmse for signal, row in by_signal.items()}


def found(_case: str, seed: int) -> pd.DataFrame:
    """Return a row: the model of `auvid fit` of one seed, next to the one with settings by hand."""
    experiment = auvid.load_experiment("field", f"seed={seed}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in field_log(auvid.simulate(experiment)).items():
            (folder / file).write_text(text, encoding="utf-8")
        survey = auvid.import_logs(folder / "map.yaml")
        by_hand, seen = tuned_survey(experiment, folder)
    begin = process_time()
    fit = auvid.fit(with_settings(survey, _SEEN))
    row: dict[str, object] = {"cpu_time": process_time() - begin, "grade": fit.judgement.grade.value}
    row |= {"reason": fit.judgement.reason, "added": "; ".join(fit.added), "trial": fit.trial}
    true, values = experiment.vehicle.all_coefficients(), fit.estimate.final_coefficients()
    off = {
        s: abs(values[s] - true[s]) / deviation for s, deviation in fit.estimate.final_deviations().items() if s in true
    }
    worst = max(off, key=lambda symbol: off[symbol])
    row |= {"worst": worst, "sigmas": off[worst]}
    row |= _errors(auvid.identify(seen, "smoother"), by_hand, "hand") | _errors(fit.estimate, survey, "fit")
    return pd.DataFrame([row])


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    rows = all_rows("field_fit", [("field", seed) for seed in range(1, seeds + 1)], found).sort_values("seed")
    better = (rows["fit_r"] < rows["file_r"]) & (rows["fit_v"] < rows["file_v"])
    close = (rows["fit_r"] <= _MARGIN * rows["hand_r"]) & (rows["fit_v"] <= _MARGIN * rows["hand_v"])
    right = rows["sigmas"] <= _WRONG
    lines = [
        f"{len(rows)} seeds. Better than the vehicle file in sway and yaw rate: {better.sum()}. At most 10 % worse "
        f"than by hand: {close.sum()}. No coefficient beyond {_WRONG:g} standard deviations: {right.sum()}. "
        f"Median processor time: {rows['cpu_time'].median():.0f} s.",
        "",
        "| seed | judged | added | yaw rate deg/s: fit | by hand | file | sway mm/s: fit | by hand | file "
        "| largest error / sd |",
        "| ---: | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for _, row in rows.iterrows():
        errors = [f"{factor * row[f'{who}_{s}']:.3g}" for s, factor in (("r", 57.2958), ("v", 1e3)) for who in _MODELS]
        worst = f"{row['sigmas']:.1f} ({row['worst']})".replace("|", r"\|")
        lines.append(f"| {row['seed']} | {row['grade']} | {row['added']} | {' | '.join(errors)} | {worst} |")
    replace_section("field fit", "\n".join(lines), "studies")


_MODELS = "fit", "hand", "file"

if __name__ == "__main__":
    main()
