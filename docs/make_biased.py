"""Study: effect of biased sensors on the estimates. Writes docs/studies.md: `python -m docs.make_biased`.

From the kept rows of `auvid campaign biased`; `--results results/campaigns/biased` reads and keeps new ones.
"""

import pandas as pd

from auvid_cli.report.table import filter_label
from docs.campaign_rows import campaign_rows, fewest, results_option
from docs.section import replace_section


def row(attitude: str, name: str, runs: pd.DataFrame, coefficients: pd.DataFrame) -> str:
    """Return the results of a filter over all seeds."""
    percent = runs["steady_state_error_percent"]
    grades = ", ".join(f"{count} {grade}" for grade, count in runs["grade"].value_counts().items())
    within = coefficients["error"] <= 2.0
    return (
        f"| {attitude} | {filter_label(name)} | {len(runs)} | {percent.mean():.3g} ± {percent.std():.2g} | "
        f"{percent.max():.3g} | {grades} | {within.mean():.1%} | {fewest(within, coefficients)} |"
    )


def main() -> None:
    """Write the section."""
    rows = campaign_rows("biased", results_option(__doc__).parse_args().results)
    lines = [
        rows.summary(),
        "",
        "| attitude | filter | runs | average error %, mean ± sd | largest | judged | within 2 sd | fewest |",
        "| --- | --- | ---: | ---: | ---: | --- | ---: | --- |",
    ]
    coefficients = rows.coefficients
    for (attitude, name), runs in rows.runs.groupby(["attitude", "filter"], sort=False):
        own = coefficients[coefficients["run"].isin(runs["run"])]
        lines.append(row(str(attitude), str(name), runs, own))
    replace_section("biased", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
