"""A lake run of a CougUV against its log as somebody else converted it, and against fits by other means.

Times here are those of the second bag, which begins 4.87 s after the converted log.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from auvid_cli.config.experiment import ImportedRun
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.estimate_file import read_estimate

pytestmark = pytest.mark.recorded

MAPS = Path(__file__).parent / "maps"
FIRST, RUN = "SO_bag_0", "SO_lastbag_mcap_0"
START = 1743805382.542393  # s, of the converted log
LATER = 1743805387.412994 - START
THRUST_OFF = 85.05
MASS, INERTIA = 16.5, 5.9  # kg, kg m^2: assumed, m - X_udot and Izz - N_rdot
NOISE = "identification.process_noise={velocity: 0.1, rate: 0.1, attitude: 0.01}"
COAST_NOISE = "identification.process_noise={velocity: 0.02, rate: 0.1, attitude: 0.01}"
PRIOR = "identification.prior.factor=1"
YAW = "identification.coefficients=[N_url, N_uudr]"
THRUST = "identification.estimate={biases: [thrust], thrust: {spread: 2}}"
FILTERS = ("ekf", "ckf", "tukf")


@pytest.fixture(scope="module")
def bag(recorded):
    return lambda name: recorded / f"couguv/{name}.mcap"


@pytest.fixture(scope="module")
def converted(recorded):
    return lambda name: np.genfromtxt(recorded / f"couguv/csv/{name}.csv", delimiter=",", names=True)


@pytest.fixture(scope="module")
def run(imported, bag):
    return lambda name="couguv", *changes: imported(bag(RUN), name, *changes)


@pytest.fixture(scope="module")
def identified(auvid, run, tmp_path_factory):
    """Function: a results folder, with several filters' estimates from a part of the run."""

    def identify(name, *options, filters=FILTERS, code=0):
        folder = tmp_path_factory.mktemp("identified")
        named = [part for each in filters for part in ("--filter", each)]
        unjudged = "--set", "identification.judge=false"
        auvid("identify", run(name), "-o", folder, *named, *options, *unjudged, code=code)
        return folder

    return identify


@pytest.fixture(scope="module")
def coasting(identified):
    settings = "--set", "identification.coefficients=[X_u|u|]", "--set", COAST_NOISE, "--set", PRIOR
    return identified("couguv", "--use", "85.1:92", *settings)


@pytest.fixture(scope="module")
def straight(identified):
    """What the rudder did on the straight parts, without the turn."""
    settings = "--set", YAW, "--set", NOISE, "--set", PRIOR, "--set", THRUST
    return identified("couguv_yaw", "--use", "3:40", "--use", "62:84", *settings)


def origin_of(dataset):
    """The log's time, s, at which a dataset begins."""
    assert isinstance(dataset.experiment, ImportedRun)
    return dataset.experiment.recording.origin


def estimate_of(folder, name):
    return read_estimate(folder / "estimates" / f"{name}.h5")


def found_by(folder, name, symbol):
    """Value and standard deviation."""
    estimate = estimate_of(folder, name)
    at = estimate.state.index(symbol)
    return estimate.mean[-1, at], estimate.standard_deviation[-1, at]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count"), [(FIRST, 143), (RUN, 660)])
def test_either_bag_is_read_by_the_stamps_of_its_messages(imported, bag, converted, name, count):
    dataset = read_dataset(imported(bag(name), "couguv"))
    dvl, theirs = dataset.sensors["dvl"], converted("dvl_velocity")
    times = dvl.time + origin_of(dataset) - START
    assert times.size == count
    nearest = np.abs(theirs["t_s"][:, None] - times).argmin(axis=0)
    np.testing.assert_allclose(times, theirs["t_s"][nearest], rtol=0, atol=2e-6)
    valid = np.isfinite(dvl.values[:, 0])
    assert count - valid.sum() <= 1
    for column, symbol in enumerate("uvw"):
        np.testing.assert_allclose(dvl.values[valid, column], theirs[f"{symbol}_m_s"][nearest][valid], atol=1e-12)


def test_signs_and_units_are_those_of_the_model(run, converted):
    dataset = read_dataset(run())
    attitude, depth, inputs = dataset.sensors["attitude"], dataset.sensors["depth"], dataset.inputs
    # Level although the modem hangs upside down, and a metre down.
    assert np.abs(np.median(attitude.values[:, 0])) < np.deg2rad(15.0)
    under_way = (depth.time > 10.0) & (depth.time < 84.0)
    assert np.median(depth.values[under_way, 0]) == pytest.approx(1.05, abs=0.05)
    turning = (inputs.time > 42.0) & (inputs.time < 58.0)
    assert (inputs.values[turning, 0] == np.deg2rad(35.0)).all()
    heading = np.unwrap(attitude.values[:, 2])
    assert np.diff(np.interp([42.0, 58.0], attitude.time, heading))[0] < np.deg2rad(-100.0)
    off = inputs.time[np.flatnonzero(inputs.values[:, 2] == 0.0)[0]]
    command = converted("controls_command")
    theirs = command["t_s"][np.flatnonzero((command["thruster_pct"] == 0.0) & (command["t_s"] > 10.0))[0]]
    assert off == pytest.approx(theirs - LATER, abs=2e-6)
    assert off == pytest.approx(THRUST_OFF, abs=0.01)


@pytest.mark.slow
def test_inspection_finds_the_swings_of_the_compass_and_the_spike_of_the_dvl(inspected, run):
    found = inspected(run(), 1)
    swings = found["attitude", "excursions of psi from heading"]
    assert swings["passed"] == "False"
    count, rest = swings["statistic"].split(", largest ")
    # One every four seconds or so on 80 s, by up to 13 deg in somebody else's words.
    assert 15 <= int(count) <= 45
    assert float(rest.split()[0]) == pytest.approx(13.0, abs=2.0)
    spike = found["dvl", "spikes"]
    assert spike["passed"] == "False"
    assert spike["statistic"].startswith("1; ")
    # At 57 s of the converted log.
    assert float(spike["statistic"].split("t = ")[1].split()[0]) + LATER == pytest.approx(57.3, abs=0.1)
    assert found["dvl", "jitter"]["passed"] == ""
    failed = {key for key, row in found.items() if row["passed"] == "False"}
    assert failed == {("attitude", "excursions of psi from heading"), ("dvl", "spikes")}


@pytest.mark.slow
def test_the_time_of_the_recording_is_named(inspected, run):
    """Nothing but the stamps contradicts a clock that is six days late as a whole."""
    late = run("couguv", ("@header_stamp", "@log_time"))
    origins = [origin_of(read_dataset(path)) for path in (run(), late)]
    assert origins[1] - origins[0] == pytest.approx(514944.06, abs=0.02)
    stamps, arrivals = (read_dataset(path).sensors["dvl"].time for path in (run(), late))
    delay = arrivals - stamps - np.median(arrivals - stamps)
    assert np.abs(delay).max() == pytest.approx(0.0155, abs=5e-4)
    right, wrong = (inspected(path, 1) for path in (run(), late))
    named = {subject for (subject, check), row in wrong.items() if "@log_time is 5.96 days after" in row["advice"]}
    assert {"dvl", "attitude"} <= named
    assert not any("@log_time" in row["advice"] for row in right.values())
    others = [{key: row["passed"] for key, row in said.items() if key[1] != "import"} for said in (right, wrong)]
    assert others[0] == others[1]


BOTH = "{bag: [%s, %s]}"


@pytest.mark.slow
@pytest.mark.parametrize(("clock", "said"), [("@log_time", True), ("@header_stamp", False)])
def test_the_better_clock_is_named_where_it_matters(auvid, bag, tmp_path, clock, said, inspected):
    """The second bag was played back first, 276 s before the one that it continues; its own stamps tell."""
    files = BOTH % (bag(FIRST), bag(RUN))
    text = (MAPS / "couguv.yaml").read_text().replace("@header_stamp", clock).replace("{bag: {}}", files)
    (tmp_path / "map.yaml").write_text(text.replace("vehicle: couguv", f"vehicle: {MAPS}/couguv"))
    output = " ".join(auvid("import", "--map", tmp_path / "map.yaml", "-o", tmp_path / "dataset.h5").split())
    remark = "magnetometer, dvl, depth: @log_time drifts from @header_stamp by 275.9 s (5 to 95 %)"
    assert (remark in output) == said
    verdicts = inspected(tmp_path / "dataset.h5", 1)
    clock = {subject for (subject, check), row in verdicts.items() if check == "import" and "drifts" in row["advice"]}
    assert ({"magnetometer", "dvl", "depth"} <= clock) == said
    # By the stamps the bags overlap, with the same messages: somebody else merged them.
    overlap = "from 1743805387.413 to 1743805398.534 s"
    assert (overlap in output) != said
    if not said:
        # As many as in the converted log.
        assert read_dataset(tmp_path / "dataset.h5").sensors["dvl"].time.size == 697


@pytest.mark.slow
def test_inspection_finds_the_wrong_pitch_of_the_dvl(inspected, run):
    """It is wrong by the same until the turn, and by little afterwards; depth and pitch agree over seconds."""
    whole = inspected(run("couguv_dvl_attitude"), 1)
    failed = {key for key, row in whole.items() if row["passed"] == "False"}
    assert failed == {("attitude", "pitch offset"), ("dvl", "spikes")}
    words = whole["attitude", "pitch offset"]["statistic"].split()
    # About 12 deg in the first 45 s in somebody else's words, of the converted log.
    assert float(words[2]) == pytest.approx(12.0, abs=1.5)
    assert float(words[words.index("to") + 1]) + LATER == pytest.approx(50.0, abs=5.0)
    until_40 = inspected(run("couguv_dvl_attitude"), 1, "--use", "0:40")["attitude", "pitch offset"]
    assert until_40["passed"] == "False"
    assert float(until_40["statistic"].split()[2]) == pytest.approx(12.0, abs=1.5)
    assert inspected(run(), 1)["attitude", "pitch offset"]["passed"] == "True"


@pytest.mark.slow
@pytest.mark.parametrize("name", FILTERS)
def test_drag_over_mass_is_that_of_the_coast_down(coasting, converted, name):
    """Against ``u = u0 / (1 + b u0 t)``, fitted to the converted log; with it b includes what little linear drag is."""
    theirs = converted("dvl_velocity")
    time = theirs["t_s"] - LATER - 85.1
    known = (time > 0.0) & (time < 6.9) & np.isfinite(theirs["u_m_s"])
    time, u = time[known], theirs["u_m_s"][known]
    fit = least_squares(lambda x: x[0] / (1.0 + x[0] * x[1] * time) - u, [0.9, 0.5])
    value, deviation = found_by(coasting, name, "X_u|u|")
    assert -value / MASS == pytest.approx(fit.x[1], rel=0.06)
    assert abs(-value / MASS - fit.x[1]) < 2.0 * deviation / MASS
    # The law that somebody else found, a u + b u|u|, at the mean speed of the segment.
    assert -value / MASS == pytest.approx(0.462 + 0.041 / u.mean(), rel=0.06)
    assert estimate_of(coasting, name).completed


@pytest.mark.slow
def test_thrust_and_drag_balance_on_the_straight(identified):
    """The gain of a propeller whose force is a guess, from steady motion at 0.958 m/s and the coast-down after it."""
    settings = "--set", "identification.coefficients=[X_u|u|]", "--set", COAST_NOISE, "--set", PRIOR, "--set", THRUST
    folder = identified("couguv_yaw", "--use", "75:92", *settings)
    for name in FILTERS:
        drag, _ = found_by(folder, name, "X_u|u|")
        stated = 30.0 * 0.35**2
        assert estimate_of(folder, name).final_actuators().thrust * stated == pytest.approx(-drag * 0.958**2, rel=0.05)


def nomoto(converted, begin=8.0, end=88.9, step=0.02):
    """Gain and time constant of ``T r' + r = K U delta + r0`` by the DVL's yaw, not differentiated; converted log."""
    yaw, command, speed = (converted(name) for name in ("dvl_dead_reckoning", "controls_command", "dvl_velocity"))
    time = np.arange(begin, end, step)
    held = np.searchsorted(command["t_s"], time, side="right") - 1
    moved = np.interp(time, speed["t_s"], speed["u_m_s"]) * np.deg2rad(command["fin_top_deg"][held])
    used = (yaw["t_s"] > begin) & (yaw["t_s"] < end - step)
    seen = np.unwrap(np.deg2rad(yaw["yaw_deg"][used]))

    def errors(x):
        gain, constant, offset, rate, psi = x
        predicted = np.empty(time.size)
        for k, wanted in enumerate(gain * moved + offset):
            predicted[k] = psi
            psi += step * rate
            rate += step * (wanted - rate) / constant
        return np.interp(yaw["t_s"][used], time, predicted) - seen

    return least_squares(errors, [0.3, 1.0, 0.03, 0.0, seen[0]]).x[:2]


@pytest.mark.slow
def test_yaw_coefficients_are_those_of_a_first_order_fit(identified, converted):
    """In yaw ``K = N_uudr / N_url`` and ``T = (Izz - N_rdot) / (-N_url U)`` where sideslip turns nothing."""
    gain, constant = nomoto(converted)
    assert gain == pytest.approx(0.308, abs=0.01)  # as somebody else found it
    folder = identified("couguv_yaw", "--use", "3:84", "--set", YAW, "--set", NOISE, "--set", PRIOR)
    for name in FILTERS:
        damping, deviation = found_by(folder, name, "N_url")
        fin, _ = found_by(folder, name, "N_uudr")
        assert fin / damping == pytest.approx(gain, rel=0.06)
        assert abs(damping + INERTIA / (constant * 0.95)) < 2.0 * deviation


@pytest.mark.slow
def test_identifiability_names_what_this_run_undetermined(auvid, run, rows, tmp_path):
    auvid("identifiability", run("couguv_yaw"), "-o", tmp_path, "--use", "3:84")
    verdicts = {row["coefficient"]: row["verdict"] for row in rows(tmp_path / "tables/identifiability.csv")}
    untold = {symbol for symbol, verdict in verdicts.items() if verdict == "not identified"}
    # It hardly heaves, pitches or rolls of its own.
    assert {"Z_w|w|", "Z_q|q|", "K_p|p|", "M_w|w|", "Z_uql", "Z_uwl"} <= untold
    assert not {"X_u|u|", "N_uudr", "N_url", "N_r|r|"} & untold
    together = [row["members"] for row in rows(tmp_path / "tables/collinear.csv")]
    assert any("N_url" in members and "N_uvl" in members for members in together)


@pytest.mark.slow
def test_all_22_need_a_narrow_prior_and_much_process_noise(identified):
    careless = identified("couguv_yaw", "--use", "3:84", code=1)
    for name in ("ckf", "tukf"):
        assert "diverged" in estimate_of(careless, name).status
    settings = "--set", NOISE, "--set", "identification.prior.factor=0.1"
    careful = identified("couguv_yaw", "--use", "3:84", *settings, filters=("ekf", "tukf"))
    for name in ("ekf", "tukf"):
        assert estimate_of(careful, name).completed


@pytest.mark.slow
def test_the_turn_is_predicted_from_the_straight_parts(auvid, run, rows, straight, tmp_path):
    """A turn of half a circle with the rudder hard over, by the rudder's small movements before and after it."""
    estimate = straight / "estimates/ekf.h5"
    # Sideslip, of which nothing was found, is worse than none: this is a verdict.
    auvid("validate", estimate, run("couguv_yaw"), "--use", "40.3:61.5", "-o", tmp_path, code=1)
    psi = [row for row in rows(tmp_path / "tables/validation.csv") if row["signal"] == "psi"]
    free = next(row for row in psi if row["kind"] == "free_run")
    assert float(free["fit_percent"]) > 85.0
    assert float(free["rmse"]) < 0.1 * float(free["constant_velocity_rmse"])
    assert float(free["rmse"]) < 0.5 * float(free["prior_rmse"])
    assert all(float(row["fit_percent"]) > 90.0 for row in psi if row["kind"] == "ahead")
    refusal = auvid("validate", estimate, run("couguv_yaw"), "--use", "30:61", "-o", tmp_path, code=2)
    assert "new to the model" in refusal


@pytest.mark.slow
def test_the_end_of_the_coast_down_is_predicted_from_its_beginning(auvid, run, rows, coasting, tmp_path):
    """But for the swings of pitch and heading, which no model of this vehicle has and no band holds."""
    auvid("validate", coasting / "estimates/tukf.h5", run(), "--use", "92.2:115", "-o", tmp_path, code=1)
    surge = [row for row in rows(tmp_path / "tables/validation.csv") if row["signal"] == "u"]
    for row in surge:
        assert float(row["fit_percent"]) > 40.0
        assert float(row["rmse"]) < float(row["prior_rmse"])
    free = next(row for row in surge if row["kind"] == "free_run")
    assert float(free["rmse"]) < 0.2 * float(free["constant_velocity_rmse"])


@pytest.mark.slow
def test_search_for_a_model_predicts_the_turn_better_than_the_vehicle_file(auvid, run, rows, tmp_path):
    """With two coefficients and settings by hand the heading is off by .064 rad, and sway by .142 m/s."""
    parts = "--use", "3:40", "--use", "62:84"
    auvid("fit", run("couguv_yaw"), *parts, "--set", "identification.prior={mean: vehicle}", "-o", tmp_path, code=1)
    auvid(
        "validate",
        tmp_path / "estimates/smoother.h5",
        run("couguv_yaw"),
        "--use",
        "40.3:61.5",
        "-o",
        tmp_path / "turn",
        code=1,
    )
    table = rows(tmp_path / "turn/tables/validation.csv")
    free = {row["signal"]: row for row in table if row["kind"] == "free_run"}
    assert float(free["psi"]["fit_percent"]) > 90.0
    assert float(free["psi"]["rmse"]) < 0.064
    assert float(free["v"]["rmse"]) < 0.142
    sway = [row for row in table if row["kind"] == "ahead_in_turns" and row["signal"] == "v"][-1]
    assert float(sway["rmse"]) < 0.5 * float(sway["vehicle_file_rmse"])
