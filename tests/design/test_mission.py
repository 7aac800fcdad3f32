"""Files for the crew of a vehicle."""

import csv
import io
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.geometry import FinSettings
from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.manoeuvre import Envelope
from auvid_cli.design.mission import (
    checklist_markdown,
    inputs_csv,
    manoeuvre_yaml,
    summarise_runs,
    timeline_markdown,
    track_geojson,
)
from auvid_cli.design.problem import baseline_spiral, search_space, standard_manoeuvres
from auvid_cli.design.trials import simulate_trial
from auvid_cli.errors import DataError


@pytest.fixture(scope="module")
def manoeuvre(remus):
    own = baseline_spiral(remus(), 30.0, None, None)
    space = search_space(own, 1.33, 1.62, Envelope())
    return space.manoeuvre(np.full(len(space.variables), 0.6))


@pytest.fixture(scope="module")
def band(remus, manoeuvre):
    softer = remus("vehicle.coefficients.N_uudr=-5 kg/rad").vehicle
    return summarise_runs([simulate_trial(remus().vehicle, manoeuvre), simulate_trial(softer, manoeuvre)])


def table(text):
    rows = list(csv.reader(io.StringIO(text)))
    return rows[0], np.array(rows[1:], dtype=float)


def fins(tail):
    return FinSettings(position=1.2, span=0.08, area=0.006, tail=tail)


def test_manoeuvre_yaml_loads_in_experiment(manoeuvre, tmp_path):
    path = tmp_path / "manoeuvre.yaml"
    path.write_text(manoeuvre_yaml(manoeuvre, "from a test"), encoding="utf-8")
    assert load_experiment(find_experiment("remus100"), [f"manoeuvre={path}"]).manoeuvre == manoeuvre


@pytest.mark.parametrize("is_spiral", [False, True])
def test_added_signals_start_and_end_at_zero_within_fin_limits(remus, manoeuvre, is_spiral):
    flown = baseline_spiral(remus(), 30.0, None, None) if is_spiral else manoeuvre
    header, rows = table(inputs_csv(flown, fins("+")))
    assert_allclose(np.diff(rows[:, 0]), 0.05, atol=1e-9)
    assert all(name.endswith("]") for name in header)
    added = [k for k, name in enumerate(header) if not name.startswith(("time", "held"))]
    assert not rows[np.ix_([0, -1], added)].any()
    angles = [k for k, name in enumerate(header) if name.startswith(("rudder", "elevator")) or " fin " in name]
    assert np.abs(rows[:, angles]).max() <= np.rad2deg(flown.limits.fin_angle) + 1e-3


def test_fin_columns_add_up_to_rudder_and_elevator(manoeuvre):
    header, rows = table(inputs_csv(manoeuvre, fins("+")))
    column = {name.partition(" [")[0]: rows[:, k] for k, name in enumerate(header)}
    assert_allclose(column["upper fin"], column["rudder"])
    assert_allclose(column["starboard fin"], column["elevator"])
    of_plus = column
    header, rows = table(inputs_csv(manoeuvre, fins("x")))
    column = {name.partition(" [")[0]: rows[:, k] for k, name in enumerate(header)}
    fins_of_x = [column[f"{place} fin"] for place in ("upper port", "upper starboard")]
    assert [np.abs(fin).max() for fin in fins_of_x] == pytest.approx([25.0, 25.0])
    # Half the sum of a pair turns to the side, half the difference up or down; where a fin is cut, both lose.
    assert_allclose(0.5 * (fins_of_x[0] + fins_of_x[1]), column["rudder"], atol=1e-3)
    assert_allclose(0.5 * (fins_of_x[0] - fins_of_x[1]), column["elevator"], atol=1e-3)
    free = (np.abs(fins_of_x) < 24.9).all(axis=0)
    assert free.sum() > 50
    assert_allclose(column["rudder"][free], of_plus["rudder"][free], atol=1e-3)
    assert "upper fin [deg]" not in inputs_csv(manoeuvre, None)


def test_track_matches_position_of_vehicle(band):
    features = json.loads(track_geojson(band, (41.18, -8.70)))["features"]
    track = np.array(features[0]["geometry"]["coordinates"])
    # On a sphere, which differs from the ellipsoid by less than half a percent.
    radius, latitude = 6371008.8, np.deg2rad(41.18)
    north = np.deg2rad(track[:, 1] - 41.18) * radius
    east = np.deg2rad(track[:, 0] + 8.70) * radius * np.cos(latitude)
    assert_allclose(north, band.position[:, 0, 1], rtol=5e-3, atol=0.01)
    assert_allclose(east, band.position[:, 1, 1], rtol=5e-3, atol=0.01)
    assert_allclose(track[:, 2], -band.position[:, 2, 1], atol=0.01)
    for box in features[1]["geometry"]["coordinates"]:
        assert box[0][0] == box[0][-1]


def test_band_lies_between_its_vehicles(band, remus, manoeuvre):
    for name in ("turned", "turn_rate", "pitch", "roll", "speed"):
        low, middle, high = getattr(band, name).T
        assert (low <= middle).all()
        assert (middle <= high).all()
    only = summarise_runs([simulate_trial(remus().vehicle, manoeuvre)])
    assert_allclose(only.position[..., 0], only.position[..., 2])
    assert only.box == pytest.approx(np.ptp(simulate_trial(remus().vehicle, manoeuvre).position[:, :2], axis=0))
    with pytest.raises(DataError, match="out of control"):
        summarise_runs([])


def test_timeline_and_checklist_state_abort_limits_and_start_depth(remus, manoeuvre, band):
    text = timeline_markdown(band, Envelope(roll=0.5), 0.62, 30.0)
    rows = [line for line in text.splitlines() if line.startswith("| ") and line[2].isdigit()]
    assert len(rows) >= 12
    assert "roll beyond 29 deg" in text
    assert "slower than 0.62 m/s for more than 5 s after the first 30 s" in text
    runs = [
        simulate_trial(remus(*softer).vehicle, manoeuvre) for softer in ((), ("vehicle.coefficients.N_uudr=-5 kg/rad",))
    ]
    ways = [float(np.linalg.norm(np.diff(run.position, axis=0), axis=1).sum()) for run in runs]
    assert min(ways) <= band.length[0] < band.length[1] <= max(ways)
    assert f"In all: 30 s, {band.length[0]:.0f} to {band.length[1]:.0f} m through the water" in text
    rising = simulate_trial(remus().vehicle, manoeuvre)
    shallow = summarise_runs([rising._replace(position=rising.position * [1.0, 1.0, 0.0] + [0.0, 0.0, -3.2])])
    assert "Begin at least 5 m deep" in checklist_markdown(manoeuvre, remus().vehicle, shallow)


def test_files_of_standard_manoeuvres_describe_rudder(remus):
    standard = standard_manoeuvres(baseline_spiral(remus(), 30.0, None, None), 1.33)
    header, rows = table(inputs_csv(standard["doublets"], None))
    rudder = rows[:, header.index("rudder [deg]")]
    assert (rudder[0], rudder[-1], rudder.max()) == pytest.approx((0.0, 0.0, 8.0))
    header, rows = table(inputs_csv(standard["zigzag"], None))
    assert not rows[:, header.index("rudder [deg]")].any()
    assert header[-2:] == ["held change of depth [m]", "held speed [m/s]"]
    around = summarise_runs([simulate_trial(remus().vehicle, standard["zigzag"])])
    text = checklist_markdown(standard["zigzag"], remus().vehicle, around)
    assert "straight for 10 s, then 20 deg to\n      starboard" in text
    assert "whenever the heading is 20 deg from" in text
    truth = simulate_trial(remus().vehicle, standard["zigzag"])
    first = truth.inputs[np.searchsorted(truth.time, 11.0), 0]
    assert first * remus().vehicle.all_coefficients()["N_uudr"] > 0.0, "to starboard"
