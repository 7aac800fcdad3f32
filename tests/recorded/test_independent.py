"""Runs of another simulator: a REMUS 100 with strip-wise cross-flow drag, linear damping and no Munk moment.

What it shows is what a model of another structure does to an estimate, and whether that is noticed.
"""

import json
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from auvid_cli.config.enums import FilterName
from auvid_cli.config.experiment import ImportedRun, RecordedFile, Recording
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.dataset import Dataset, InputRecord
from auvid_cli.errors import DataError
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.estimate_checks import check_estimate
from auvid_cli.evaluation.judgement import judge_one, status_of
from auvid_cli.fitting.search import FitLimits, fit_model
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.inspection.inspect import inspect_dataset
from auvid_cli.simulation.simulate import corrupt, sample_times
from auvid_cli.validation.data_leakage import check_unseen
from auvid_cli.validation.results import Prediction
from auvid_cli.validation.validate import validate

SHARED = Path(os.environ.get("AUVID_SHARED", Path(__file__).parents[2].parent / "shared"))
RUNS = SHARED / "independent/fossen_remus100"
pytestmark = [
    pytest.mark.recorded,
    pytest.mark.skipif(not RUNS.is_dir(), reason="runs of another simulator do not ship with auvid"),
]

COLUMNS = {"gyroscope": "pqr", "dvl": "uvw", "attitude": ("phi", "theta", "psi")}
# What the model leaves out, as white noise: with this the innovations of run E are as large as the filter says.
ATTITUDE = "sensors.attitude={source: direct, rate: 100 Hz, noise: 0.1 deg}"
LOOSE = "identification.process_noise.velocity=3e-3", "identification.process_noise.rate=3e-3"

# What `auvid terms` finds in run E, with this noise, in this order: some ten fits for each, so it is not searched here.
FOUND = (
    'vehicle.terms=[{name: N_|v|r, row: N, factors: ["|v|", r]}, {name: K_p, row: K, factors: [p]}, '
    '{name: M_q, row: M, factors: [q]}, {name: N_r, row: N, factors: [r]}, {name: Y_|r|v, row: Y, factors: ["|r|", v]}]'
)

# What `auvid tune` finds with these, rounded, and what a second `auvid terms` finds then: less than the noise before.
TUNED = (
    "identification.process_noise={velocity: [7.9e-4, 3.8e-4, 1e-4], rate: [3e-5, 1.4e-4, 6.2e-4], attitude: 8e-5}",
    FOUND[:-1] + ", {name: X_vr, row: X, factors: [v, r]}, {name: X_vv, row: X, factors: [v, v]}, "
    '{name: X_uu|rudder|, row: X, factors: [u, u, "|rudder|"]}, {name: X_|w||q|, row: X, factors: ["|w|", "|q|"]}, '
    '{name: N_|p|v, row: N, factors: ["|p|", v]}, {name: N_|v|p, row: N, factors: ["|v|", p]}]',
)


@pytest.fixture(scope="module")
def vehicle():
    """Mass, inertia and added mass as that simulator states them, and nothing of its damping or fins."""
    stated = json.loads((RUNS / "parameters.json").read_text())
    mass, size = stated["mass"], stated["geometry"]
    rigid, added = np.array(mass["MRB"]), np.diagonal(mass["MA"])
    parameters = {symbol: mass[symbol] for symbol in ("m", "W", "B")}
    parameters |= dict(zip(("Ixx", "Iyy", "Izz"), np.diagonal(rigid)[3:].tolist(), strict=True))
    parameters |= dict(zip(("xG", "yG", "zG", "xB", "yB", "zB"), [*size["r_bg"], *size["r_bb"]], strict=True))
    names = ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")
    parameters |= dict(zip(names, (-added).tolist(), strict=True))
    parameters |= dict.fromkeys(("Y_rdot", "Z_qdot", "M_wdot", "N_vdot", "K_prop"), 0.0) | {"X_prop": 10.0}
    hull = {"length": size["L"], "diameter": size["diam"], "density": size["rho"]}
    return VehicleSettings.model_validate({"name": "REMUS 100 by strips", "size": hull, "parameters": parameters})


@pytest.fixture(scope="module")
def recorded(vehicle, experiment_with):
    """Function: a run with the noise and the rates of Table III, commands before the lag of the fins."""
    suite = experiment_with(ATTITUDE, "sensors.gyroscope.rate=100 Hz").sensors

    def make(name: str, seed: int, *settings: str) -> Dataset:
        run = pd.read_csv(RUNS / f"{name}.csv.gz")
        time = run["t"].to_numpy(np.float64)
        sensors = {}
        for sensor, columns in COLUMNS.items():
            clock = getattr(suite, sensor)
            at = sample_times(clock, time[-1])
            true = np.stack([np.interp(at, time, run[column].to_numpy(np.float64)) for column in columns], axis=1)
            sensors[sensor] = corrupt(at, true, clock, sensor, seed)
        # There, positive rudder turns to starboard.
        inputs = np.stack([-run["delta_r_cmd"], run["delta_s_cmd"], run["thrust"], run["K_prop"]], axis=1)
        file = RecordedFile(name=name, sha256=f"of {name}")
        plain = ImportedRun(
            name=name, vehicle=vehicle, recording=Recording(files=(file,), map="by this test", origin=0.0)
        )
        # Mass and inertia are those of that simulator, without an error.
        exact = "identification.tolerances=none"
        overrides = ("vehicle.actuators.fins.time_constant=0.1 s", exact, *settings)
        experiment = parse_run(dump_experiment(plain), "test", overrides)
        return Dataset(InputRecord(time, inputs.astype(np.float64)), sensors, experiment, sha256=f"{name} {seed}")

    return make


@pytest.fixture(scope="module")
def training(recorded):
    return recorded("E_combined_multisine", 1)


@pytest.fixture(scope="module")
def loosely_identified(recorded):
    return identify(recorded("E_combined_multisine", 1, *LOOSE), FilterName.TUKF)


def test_nothing_is_wrong_with_the_data_themselves(training):
    assert not [check for check in inspect_dataset(training).checks if check.passed is False]


@pytest.mark.slow
@pytest.mark.parametrize("name", [FilterName.TUKF, FilterName.OUTPUT_ERROR])
def test_the_mismatch_of_the_structure_is_noticed(name, training):
    estimate = identify(training, name)
    assert status_of(estimate).startswith("inconsistent")
    checks = check_estimate(
        prepare(training), estimate, BoundsOf(prepare(training))(estimate), judge_one(estimate, None), []
    )
    failed = {(check.subject, check.check) for check in checks if check.passed is False}
    assert {(sensor, "NIS") for sensor in COLUMNS} <= failed
    assert {("gyroscope", "whiteness"), ("dvl", "whiteness"), ("dvl", "uncorrelated with inputs")} <= failed


def test_what_both_models_share_agrees_and_the_rest_does_not(loosely_identified):
    """In the vertical plane, where there is no strip-wise drag, within three of the stated deviations."""
    assert status_of(loosely_identified) == "completed"
    state, deviation = loosely_identified.state, loosely_identified.standard_deviation[-1]
    found = loosely_identified.final_coefficients()
    stated = json.loads((RUNS / "parameters.json").read_text())
    own, added = stated["equivalent_coefficients_SI"], np.diagonal(stated["mass"]["MA"])
    # Without a Munk moment of its own, that model has ours with the opposite sign as lift.
    munk = added[2] - added[0]
    for symbol, true in {
        "Z_uude": own["Z_uuds"],
        "M_uude": own["M_uuds"],
        "Z_uwl": own["Z_uw"],
        "Z_uql": -added[0],
        "M_uwl": -munk,
    }.items():
        assert abs(found[symbol] - true) < 3.0 * deviation[state.index(symbol)], symbol
    # Close, and yet beyond what is stated: linear damping and drag by strips have gone into them.
    assert found["X_u|u|"] == pytest.approx(own["X_uu"], rel=2e-3)
    assert found["N_uudr"] == pytest.approx(-own["N_uudr"], rel=0.03)
    assert found["N_uvl"] == pytest.approx(munk, rel=0.05)
    assert abs(found["Y_uudr"] + own["Y_uudr"]) > 10.0 * deviation[state.index("Y_uudr")]


@pytest.mark.slow
def test_it_predicts_a_zigzag_that_it_has_never_seen(loosely_identified, recorded, training):
    unseen = recorded("B_zigzag_10_10", 2)
    check_unseen(unseen, loosely_identified, training)
    found = validate([unseen], loosely_identified, recorded("E_combined_multisine", 1, *LOOSE))
    fits = {row.signal: row.fit_percent for row in found.predictions if row.kind == "free_run"}
    assert fits["v"] > 90.0
    assert min(fits["r"], fits["psi"]) > 80.0
    # Errors grow as on run E, in proportion to the motion; but for roll, of which that model has other terms. Heave and
    # pitch, of which nothing is missing, have the process noise that stands for what is missing of sway and yaw.
    failed = {check.check: check.statistic for check in found.checks if check.passed is False}
    assert set(failed) == {"uncertainty not too small", "uncertainty not too large"}
    assert failed["uncertainty not too small"].startswith("p at")
    # The bands of theta hold all but a few errors, and are at the limit.
    assert {"w", "q"} <= set(failed["uncertainty not too large"].split()[::3]) <= {"w", "q", "theta"}
    held = {(row.signal, row.horizon_s): row.share_within_band for row in found.predictions if row.kind == "ahead"}
    assert min(held[signal, horizon] for signal in "uvwqr" for horizon in (0.5, 5.0, 50.0)) > 0.85
    assert held["p", 5.0] < 0.85


@pytest.mark.slow
def test_with_the_terms_that_are_found_in_run_e_it_predicts_the_zigzag_better_and_its_bands_hold(recorded):
    def ahead(*settings: str) -> list[Prediction]:
        run_e = recorded("E_combined_multisine", 1, *LOOSE, *settings)
        return validate([recorded("B_zigzag_10_10", 2)], identify(run_e, FilterName.SMOOTHER), run_e).predictions

    def errors(rows: list[Prediction]) -> dict[tuple[str, float], float]:
        return {(row.signal, row.horizon_s): row.rmse for row in rows if row.kind in ("free_run", "ahead")}

    found = ahead(FOUND)
    plain, with_terms = errors(ahead()), errors(found)
    # The last is that of the free run, of 195 s.
    horizons = 5.0, 50.0, max(horizon for _, horizon in plain)
    assert horizons[-1] > 190.0
    assert all(3.0 * with_terms[signal, horizon] < plain[signal, horizon] for signal in "vpr" for horizon in horizons)
    bands = {signal: [row for row in found if (row.kind, row.signal) == ("ahead", signal)] for signal, _ in plain}
    held = {signal: [row.share_within_band for row in rows] for signal, rows in bands.items()}
    assert all(np.mean(shares) > 0.85 and min(shares) > 0.75 for shares in held.values())


@pytest.mark.slow
def test_with_tuned_noise_and_a_second_look_its_bands_are_those_of_its_errors(recorded):
    """Those of surge apart: it has one error from all starts, which a band holds or does not."""
    run_e = recorded("E_combined_multisine", 1, *TUNED)
    found = validate([recorded("B_zigzag_10_10", 2)], identify(run_e, FilterName.SMOOTHER), run_e)
    fits = {row.signal: row.fit_percent for row in found.predictions if row.kind == "free_run"}
    assert min(fits[signal] for signal in ("v", "r", "psi")) > 97.0
    assert fits["p"] > 85.0
    ahead = [row for row in found.predictions if row.kind == "ahead"]
    held = {signal: [row.share_within_band for row in ahead if row.signal == signal] for signal in "vwpqr"}
    assert min(map(min, held.values())) > 0.78
    assert max(np.mean(shares) for shares in held.values()) < 0.98
    assert "uncertainty not too large" not in {check.check for check in found.checks if check.passed is False}


@pytest.mark.slow
def test_search_for_a_model_predicts_the_zigzag_as_settings_by_hand_do(recorded):
    fit = fit_model(recorded("E_combined_multisine", 1), FitLimits())
    assert {"term N_|v|r", "term M_q", "term N_r", "term K_up"} <= set(fit.added)
    found = validate([recorded("B_zigzag_10_10", 2)], fit.estimate, recorded("E_combined_multisine", 1))
    fits = {row.signal: row.fit_percent for row in found.predictions if row.kind == "free_run"}
    assert min(fits[signal] for signal in ("v", "r", "psi")) > 95.0
    assert fits["p"] > 85.0


def test_run_e_is_refused_as_validation_of_itself(loosely_identified, training):
    with pytest.raises(DataError, match="this time of the same data"):
        check_unseen(training, loosely_identified, training)
