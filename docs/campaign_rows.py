"""Results of the finished runs of a shipped campaign."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from auvid_cli.campaign.plan import CampaignPlan
from auvid_cli.campaign.store import Store
from auvid_cli.campaign.summary import in_planned_order
from auvid_cli.config.campaign import load_campaign
from auvid_cli.config.loading import find_campaign
from docs.resumable import keep_rows, kept_rows, seed_range


class CampaignRows(NamedTuple):
    """Plan of a campaign, and rows of its finished runs in the order of the plan."""

    plan: CampaignPlan
    rows: pd.DataFrame

    @property
    def runs(self) -> pd.DataFrame:
        """Return one row per run."""
        return self.rows[self.rows["kind"] == "run"]

    @property
    def coefficients(self) -> pd.DataFrame:
        """Return one row per coefficient and run, with its `error` in standard deviations from the data."""
        own = self.rows[self.rows["kind"] == "coefficient"]
        deviation = own["corrected_standard_deviation"].fillna(own["standard_deviation"])
        return own.assign(error=(own["estimate"] - own["true"]).abs() / deviation)

    def summary(self) -> str:
        """Return a sentence with the number of runs and their seeds."""
        runs, name = self.runs, self.plan.campaign.name
        return f"{len(runs)} of the {self.plan.n_runs} runs of `auvid campaign {name}`, {seed_range(runs['seed'])}."


def results_option(description: str | None) -> argparse.ArgumentParser:
    """Return a command line with the results folder of a campaign; without it, the kept rows are used."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, help="results folder; its rows are then kept in docs/rows")
    return parser


def campaign_rows(
    name: str,
    results: Path | None,
    kinds: Sequence[str] = ("run", "coefficient"),
    columns: Sequence[str] | None = None,
) -> CampaignRows:
    """Return the kept rows of a campaign; from a results folder, some kinds and columns are kept first."""
    path = find_campaign(name)
    plan = CampaignPlan(*load_campaign(path), path)
    if results is not None:
        labels = plan.labels()
        rows = in_planned_order(Store(results, plan.columns).rows(labels).to_pandas(), labels)
        own = rows[rows["kind"].isin(kinds)].dropna(axis="columns", how="all")
        keep_rows(name, own if columns is None else own[[*columns]])
    kept = kept_rows(name)
    if kept is None:
        raise SystemExit(f"docs/rows: no rows of {name}; run `auvid campaign {name}`, then use --results")
    return CampaignRows(plan, kept)


def fewest(within: pd.Series, coefficients: pd.DataFrame) -> str:
    """Return the coefficient with the smallest share of rows that are within, and this share, as text of a table."""
    shares = within.groupby(coefficients["name"]).mean()
    return f"{shares.idxmin()} {shares.min():.0%}".replace("|", r"\|")
