"""Put what `auvid campaign regimes` found into docs/studies.md: then run `python -m docs.make_regimes`."""

import argparse
import shutil
from pathlib import Path

import pandas as pd

from auvid_cli.campaign.summary import CampaignSummary, summarize
from auvid_cli.report.campaign_results import comparison_sentences
from auvid_cli.report.table import setting_text
from benchmarks.timing import described_machine
from docs.campaign_rows import campaign_rows
from docs.section import replace_section

_IMAGES = Path(__file__).with_name("images")
# Against which the others are held in the table.
_REFERENCE = "ckf"


def cell(row: pd.Series) -> str:
    """Return the median error of a filter, and the shares of its runs that did not end well."""
    error = f"{row['steady_state_error_percent']:.3g}" if pd.notna(row["steady_state_error_percent"]) else "-"
    notes = [
        f"{row[share]:.0%} {word}" for share, word in (("diverged", "lost"), ("inconsistent", "inc.")) if row[share]
    ]
    return f"{error} ({', '.join(notes)})" if notes else error


def against_reference(found: CampaignSummary, settings: dict[str, object]) -> str:
    """Put into words what the comparisons with the reference filter say in one combination of settings."""
    own = found.comparisons[found.comparisons["measure"] == "steady_state_error_percent"]
    for column, value in settings.items():
        own = own[own[column] == value]
    said: dict[str, list[str]] = {}
    for row in own.to_dict("records"):
        if _REFERENCE in (row["first"], row["second"]):
            other = row["second"] if row["first"] == _REFERENCE else row["first"]
            said.setdefault(row["conclusion"].replace(other, "it"), []).append(other)
    words = {
        "tie": "tie",
        "no difference found": "no difference found",
        "it is better": "better",
        f"{_REFERENCE} is better": "worse",
        "it diverges more often": "lost more often",
        f"{_REFERENCE} diverges more often": "lost less often",
    }
    return "; ".join(f"{words[conclusion]}: {', '.join(others)}" for conclusion, others in said.items())


def main() -> None:
    """Read the results and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results/campaigns/regimes"))
    options = parser.parse_args()
    plan, rows = campaign_rows("regimes", options.results)
    found = summarize(rows, plan.fixed_columns)
    n_runs = len(found.runs)
    if n_runs < plan.n_runs:
        raise SystemExit(f"{options.results}: {n_runs} of {plan.n_runs} runs; finish it with `auvid campaign regimes`")
    names = [variant.name for variant in plan.filters]
    table = []
    for key, own in found.filters.groupby(found.columns, sort=False):
        by_name = own.set_index("filter")
        settings = dict(zip(found.columns, key, strict=True))
        table.append(
            [*map(setting_text, key), *(cell(by_name.loc[name]) for name in names), against_reference(found, settings)]
        )
    header = [*(column.split(".", 1)[-1] for column in found.columns), *names, f"against {_REFERENCE}"]
    lines = [
        *(f"- {name}: {value}" for name, value in described_machine().items() if name != "processor"),
        f"- {n_runs} runs: {len(plan.campaign.seed_list)} seeds in each cell",
        "",
        "| " + " | ".join(header) + " |",
        "| " + " | ".join(["---"] * len(header)) + " |",
        *("| " + " | ".join(row) + " |" for row in table),
        "",
        *(f"- {sentence}" for sentence in comparison_sentences(found)),
    ]
    replace_section("regimes", "\n".join(lines), page="studies")
    shutil.copyfile(options.results / "figures/map.png", _IMAGES / "regimes.png")


if __name__ == "__main__":
    main()
