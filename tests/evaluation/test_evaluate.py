"""What a report has to say about its estimates together."""

import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify


@pytest.mark.slow
def test_estimates_of_different_parts_of_the_data_are_told_apart(short_run, short_estimates, with_settings):
    whole = [short_estimates[name] for name in (FilterName.CKF, FilterName.TUKF)]
    assert evaluate(prepare(short_run), whole, BoundsOf(prepare(short_run))).remarks == []
    part = identify(with_settings(short_run, "identification.use.spans=[[0, 30]]"), FilterName.UKF)
    (remark,) = evaluate(prepare(short_run), [*whole, part], BoundsOf(prepare(short_run))).remarks
    assert remark.startswith("estimates from different parts of the data")
    assert "ukf 0.04 to 30 s" in remark
    assert "tukf 0.04 to 60 s" in remark
