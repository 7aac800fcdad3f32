"""Predictions ahead without bands are those of a whole validation."""

import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.data.dataset import cut
from auvid_cli.identification.run import identify
from auvid_cli.validation.validate import predict, validate


@pytest.mark.slow
def test_predictions_without_bands_equal_those_of_validate(multisine_with):
    dataset = multisine_with()
    estimate = identify(dataset, FilterName.SMOOTHER)
    unseen = [cut(dataset.without_truth(), 10.0, 40.0)]
    whole = [row for row in validate(unseen, estimate, starts=20).predictions if row.kind.startswith("ahead")]
    quick = predict(unseen, estimate, 20)
    assert [(row.kind, row.signal, row.horizon_s) for row in quick] == [
        (row.kind, row.signal, row.horizon_s) for row in whole
    ]
    for name in ("rmse", "vehicle_file_rmse", "constant_velocity_rmse"):
        assert [getattr(row, name) for row in quick] == pytest.approx(
            [getattr(row, name) for row in whole], nan_ok=True
        )
