"""Whether corrected standard deviations hold, into docs/studies.md: `python -m docs.make_coloured`.

From the kept rows of `auvid campaign coloured`; `--results results/campaigns/coloured` reads and keeps new ones.
"""

from collections.abc import Hashable

import pandas as pd

from auvid_cli.report.table import filter_label
from docs.campaign_rows import campaign_rows, fewest, results_option
from docs.section import replace_section


def row(case: tuple[Hashable, ...], coefficients: pd.DataFrame) -> str:
    """Return how often two standard deviations contain the truth, nominal and corrected."""
    manoeuvre, attitude, name = case
    error = (coefficients["estimate"] - coefficients["true"]).abs()
    nominal, corrected = coefficients["standard_deviation"], coefficients["corrected_standard_deviation"]
    within = error <= 2.0 * corrected
    return (
        f"| {manoeuvre} | {attitude} | {filter_label(str(name))} | {coefficients['run'].nunique()} | "
        f"{(error <= 2.0 * nominal).mean():.1%} | {within.mean():.1%} | {fewest(within, coefficients)} | "
        f"{(corrected / nominal).median():.2f} | {(corrected / nominal).max():.2f} |"
    )


def main() -> None:
    """Write the section."""
    rows = campaign_rows("coloured", results_option(__doc__).parse_args().results)
    coefficients = rows.coefficients[rows.coefficients["corrected_standard_deviation"].notna()]
    lines = [
        rows.summary(),
        "",
        "| manoeuvre | attitude | method | runs | within 2 nominal sd | within 2 corrected sd | fewest "
        "| corrected / nominal, median | largest |",
        "| --- | --- | --- | ---: | ---: | ---: | --- | ---: | ---: |",
    ]
    keys = ["manoeuvre", "attitude", "filter"]
    lines += [row(case, cell) for case, cell in coefficients.groupby(keys, sort=False)]
    replace_section("coloured", "\n".join(lines), "studies")


if __name__ == "__main__":
    main()
