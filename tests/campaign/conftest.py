"""Small campaigns: a few seconds of data, few combinations."""

from pathlib import Path

import pytest

from auvid_cli.campaign.plan import CampaignPlan
from auvid_cli.config.campaign import load_campaign

SHORT = """\
name: short
settings: {manoeuvre.duration: 5 s, identification.judge: false}
seeds: 2
filters: [ckf, tukf]
"""


@pytest.fixture
def planned(tmp_path):
    """Function: the plan of a campaign file with some text."""

    def plan(text: str, *overrides: str) -> CampaignPlan:
        path: Path = tmp_path / "campaign.yaml"
        path.write_text(text)
        return CampaignPlan(*load_campaign(path, overrides), path)

    return plan
