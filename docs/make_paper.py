"""Put the result of `auvid campaign paper` into docs/studies.md: `python -m docs.make_paper`.

The rows of the campaign are kept in docs/rows/paper.csv.gz; `--results results/campaigns/paper` reads them again.
"""

import numpy as np
import pandas as pd

from auvid_cli.report.table import filter_label
from auvid_cli.report.table_iv import published
from docs.campaign_rows import campaign_rows, results_option
from docs.section import replace_section

COLUMNS = ["filter", "seed", "name", "true", "estimate", "standard_deviation", "corrected_standard_deviation", "rmse"]
COLUMNS += ["steady_state_error_percent", "grade", "reason"]


def labelled(name: str) -> str:
    """Return the label of a filter variant."""
    return "EKF, exact transition" if name == "ekf_exact" else filter_label(name)


def per_run(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each filter and seed: mean error, relative RMSE, rows below the paper's, coverage."""
    paper = published("table_iv")
    deviation = rows["corrected_standard_deviation"].fillna(rows["standard_deviation"])
    keys = rows["filter"].str.split("_").str[0].radd("rmse_")
    theirs = [float(paper[name].get(key, "nan")) for name, key in zip(rows["name"], keys, strict=True)]
    own = rows.assign(
        relative=rows["rmse"] / rows["true"].abs(),
        below=rows["rmse"] < theirs,
        distance=(rows["estimate"] - rows["true"]).abs() / deviation,
    )
    groups = own.groupby(["filter", "seed"], sort=False)
    return pd.DataFrame(
        {
            "error": groups["steady_state_error_percent"].mean(),
            "relative": groups["relative"].median(),
            "below": groups["below"].sum(),
            "within": groups["distance"].agg(lambda distance: float((distance <= 2.0).mean())),
            "largest": groups["distance"].max(),
            "grade": groups["grade"].first(),
        }
    ).reset_index()


def difference(runs: pd.DataFrame, first: str, second: str) -> str:
    """Return the mean difference of the error of two filters over the same seeds, with its standard error."""
    errors = runs.pivot(index="seed", columns="filter", values="error")
    differences = (errors[first] - errors[second]).dropna()
    return f"{differences.mean():+.4f} ± {differences.std() / np.sqrt(len(differences)):.4f} %"


def table(runs: pd.DataFrame) -> list[str]:
    """Return the lines of the table, a row for each filter."""
    lines = [
        "| filter | steady-state error %, mean | RMSE / true value, median | rows with a smaller RMSE than the paper, "
        "median (smallest) | within 2 sd | largest error / sd | judged sound |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, own in runs.groupby("filter", sort=False):
        is_in_paper = str(name).split("_")[0] in ("ekf", "ckf", "tukf")
        below = f"{own['below'].median():.0f} ({own['below'].min():.0f}) of 22" if is_in_paper else ""
        lines.append(
            f"| {labelled(str(name))} | {own['error'].mean():.3f} | {own['relative'].median():.3g} | {below} | "
            f"{own['within'].mean():.1%} | {own['largest'].max():.1f} | {(own['grade'] == 'sound').sum()} |"
        )
    return lines


def main() -> None:
    """Read the rows and write the section."""
    rows = campaign_rows("paper", results_option(__doc__).parse_args().results, kinds=("coefficient",), columns=COLUMNS)
    runs = per_run(rows.rows)
    doubted = (
        runs[runs["grade"] != "sound"].groupby("seed")["filter"].agg(lambda names: ", ".join(map(labelled, names)))
    )
    seeds = runs["seed"]
    lines = [
        f"Seeds {seeds.min()} to {seeds.max()}, {len(runs)} runs.",
        "",
        *table(runs),
        "",
        f"- CKF minus TUKF, steady-state error: {difference(runs, 'ckf', 'tukf')}, mean and standard error.",
        f"- EKF minus CKF: {difference(runs, 'ekf', 'ckf')}; EKF with the exact transition minus EKF: "
        f"{difference(runs, 'ekf_exact', 'ekf')}.",
        *(f"- Seed {seed}, not judged sound: {names}." for seed, names in doubted.items()),
    ]
    replace_section("paper", "\n".join(lines), page="studies")


if __name__ == "__main__":
    main()
