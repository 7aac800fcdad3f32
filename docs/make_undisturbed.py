"""Study: cost of tuning the noise without a disturbance. `python -m docs.make_undisturbed`, an hour.

The smoother on the experiment `raw_inertial`: the default spiral with biased sensors, of which nothing disturbs the
motion. Rows are kept; finished seeds are not repeated.
"""

import numpy as np
import pandas as pd

import auvid_cli as auvid
from docs.resumable import all_rows, asked_seeds
from docs.section import replace_section

CASES = {
    "from the data": ("identification.noise=estimate",),
    "as stated": (),
}
_DENSITIES = ("velocity", "rate", "attitude")


def found(settings: tuple[str, ...], seed: int) -> pd.DataFrame:
    """Identify one seed: one row."""
    dataset = auvid.simulate(auvid.load_experiment("raw_inertial", *settings, f"seed={seed}"))
    estimate = auvid.identify(dataset, "smoother")
    rows = auvid.evaluate(dataset, estimate).to_pandas()["coefficients"]
    noise = estimate.experiment.identification.process_noise
    bound = rows["cramer_rao_bound"]
    row = {
        "status": estimate.status,
        "error_percent": rows["steady_state_error_percent"].mean(),
        "squared_error_by_bound": (((rows["estimate"] - rows["true"]) / bound) ** 2).mean(),
        "deviation_by_bound": (rows["standard_deviation"] / bound).median(),
        "within": ((rows["estimate"] - rows["true"]).abs() <= 2.0 * rows["standard_deviation"]).mean(),
    }
    # One value for all axes, as in the stated settings.
    return pd.DataFrame([row | {name: getattr(noise, name)[0] for name in _DENSITIES}])


def table(rows: pd.DataFrame) -> list[str]:
    """Return the results of each case."""
    lines = [
        "| process noise | seeds | completed | average error %, mean ± sd | largest | error / bound, RMS | "
        "sd / bound, median | within 2 sd | densities, median |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for case, each in rows.groupby("case", sort=False):
        percent = each["error_percent"]
        densities = ", ".join(f"{name} {each[name].median():.2g}" for name in _DENSITIES)
        lines.append(
            f"| {case} | {each['seed'].nunique()} | {(each['status'] == 'completed').sum()} | "
            f"{percent.mean():.3f} ± {percent.std():.3f} | {percent.max():.3f} | "
            f"{np.sqrt(each['squared_error_by_bound'].mean()):.3f} | {each['deviation_by_bound'].median():.3f} | "
            f"{each['within'].mean():.1%} | {densities} |"
        )
    return lines


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 50)
    runs = [(name, seed) for seed in range(1, seeds + 1) for name in CASES]
    rows = all_rows("undisturbed", runs, lambda name, seed: found(CASES[name], seed))
    replace_section("undisturbed", "\n".join(table(rows)), "studies")


if __name__ == "__main__":
    main()
