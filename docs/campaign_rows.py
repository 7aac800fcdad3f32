"""What the runs of a campaign that ships found, as far as there are any."""

from pathlib import Path
from typing import NamedTuple

import pandas as pd

from auvid_cli.campaign.findings import in_order
from auvid_cli.campaign.plan import CampaignPlan
from auvid_cli.campaign.store import Store
from auvid_cli.config.campaign import load_campaign
from auvid_cli.config.load import find_campaign


class CampaignRows(NamedTuple):
    """Runs that are done.

    Attributes
    ----------
    runs, coefficients : pandas.DataFrame
        A row for each run, and for each coefficient of each; the latter with their `error`, standard deviations.
    n_planned : int
        Runs of the whole campaign.
    """

    runs: pd.DataFrame
    coefficients: pd.DataFrame
    n_planned: int

    def said(self, name: str) -> str:
        """Say how many runs there are, and of which seeds."""
        seeds = self.runs["seed"]
        return (
            f"{len(self.runs)} of the {self.n_planned} runs of `auvid campaign {name}`, seeds {seeds.min()} to "
            f"{seeds.max()}."
        )


def campaign_rows(name: str, results: Path) -> CampaignRows:
    """Read them from a campaign's results folder."""
    path = find_campaign(name)
    plan = CampaignPlan(*load_campaign(path), path)
    rows = in_order(Store(results, plan.columns).rows(plan.labels()).to_pandas(), plan.labels())
    runs, coefficients = (rows[rows["kind"] == kind].copy() for kind in ("run", "coefficient"))
    off = (coefficients["estimate"] - coefficients["true"]).abs()
    coefficients["error"] = off / coefficients["standard_deviation"]
    return CampaignRows(runs, coefficients, plan.n_runs)
