"""What the runs of a campaign that ships found, as far as there are any."""

from pathlib import Path
from typing import NamedTuple

import pandas as pd

from auvid_cli.campaign.plan import CampaignPlan
from auvid_cli.campaign.store import Store
from auvid_cli.campaign.summary import in_planned_order
from auvid_cli.config.campaign import load_campaign
from auvid_cli.config.loading import find_campaign


class CampaignRows(NamedTuple):
    """Runs that are done.

    Attributes
    ----------
    plan : CampaignPlan
        Of all of them.
    rows : pandas.DataFrame
        Of everything that was measured, in the order of the plan.
    """

    plan: CampaignPlan
    rows: pd.DataFrame

    @property
    def runs(self) -> pd.DataFrame:
        """Return a row for each run."""
        return self.rows[self.rows["kind"] == "run"]

    @property
    def coefficients(self) -> pd.DataFrame:
        """Return a row for each coefficient of each run, with its `error`, standard deviations."""
        own = self.rows[self.rows["kind"] == "coefficient"]
        return own.assign(error=(own["estimate"] - own["true"]).abs() / own["standard_deviation"])

    def said(self) -> str:
        """Say how many runs there are, and of which seeds."""
        seeds = self.runs["seed"]
        return (
            f"{len(seeds)} of the {self.plan.n_runs} runs of `auvid campaign {self.plan.campaign.name}`, seeds "
            f"{seeds.min()} to {seeds.max()}."
        )


def campaign_rows(name: str, results: Path) -> CampaignRows:
    """Read them from a campaign's results folder."""
    path = find_campaign(name)
    plan = CampaignPlan(*load_campaign(path), path)
    labels = plan.labels()
    return CampaignRows(plan, in_planned_order(Store(results, plan.columns).rows(labels).to_pandas(), labels))


def fewest(within: pd.Series, coefficients: pd.DataFrame) -> str:
    """Name the coefficient of which the smallest share is within something, with that share, for a cell of a table."""
    shares = within.groupby(coefficients["name"]).mean()
    return f"{shares.idxmin()} {shares.min():.0%}".replace("|", r"\|")
