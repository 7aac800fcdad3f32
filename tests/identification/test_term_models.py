"""Training and held-out data of the term search."""

import numpy as np

from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.terms import split


def test_a_third_of_the_time_is_held_out_wherever_segments_end(multisine_with, with_settings):
    whole, spans = multisine_with("manoeuvre.duration=30 s"), [[0, 12], [16, 22], [24, 30]]
    dataset = with_settings(whole, f"identification.use.spans={spans}")
    fitted, held_out = split(prepare(dataset))
    first, second = fitted
    assert np.allclose([*first, *second], [0.0, 12.0, 16.0, 20.0], atol=0.2)
    assert np.allclose([end for span in held_out for end in span], [20.0, 22.0, 24.0, 30.0], atol=0.2)
