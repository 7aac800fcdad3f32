"""Plans of manoeuvres: inputs and setpoints over time."""

import os

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.errors import ConfigError
from auvid_cli.simulation.manoeuvres import make_plan, multisine


@pytest.fixture
def plan_of(experiment_with):
    """Function: the plan of a manoeuvre given as YAML."""

    def plan(manoeuvre: str, *overrides: str):
        return make_plan(experiment_with(f"manoeuvre={manoeuvre}", *overrides).manoeuvre)

    return plan


def test_ticks_cover_the_run(plan_of):
    plan = plan_of("{type: multisine, duration: 12.5 s, speed: 1 m/s, input_rate: 20 Hz}")
    assert_allclose(plan.time, np.linspace(0.0, 12.5, 251), rtol=1e-15)


def test_doublets_are_3211_of_rudder_then_elevator(plan_of):
    plan = plan_of("{type: doublets, duration: 80 s, speed: 1 m/s, rudder: 5 deg, elevator: 3 deg, unit_time: 2 s}")
    # Units of 2 s: + for 3, - for 2, + for 1, - for 1, then 5 s of rest; 19 s in all per fin.
    pattern = [(0, 6, 1), (6, 10, -1), (10, 12, 1), (12, 14, -1)]
    expected = np.zeros((plan.time.size, 2))
    for repeat in range(3):
        for fin, angle in enumerate(np.deg2rad([5.0, 3.0])):
            for begin, end, sign in pattern:
                offset = 19 * (2 * repeat + fin)
                during = (plan.time >= offset + begin) & (plan.time < offset + end)
                expected[during, fin] = sign * angle
    assert_allclose(plan.feedforward[:, :2], expected)
    assert np.all(plan.feedforward[:, 2:] == 0.0)


def test_lawnmower_has_half_turns_to_alternating_sides(plan_of):
    plan = plan_of("{type: lawnmower, duration: 100 s, speed: 1 m/s, leg: 20 s, turn_rate: 9 deg/s, input_rate: 10 Hz}")
    turned = np.concatenate([[0.0], np.cumsum(plan.turn_rate[:-1]) / 10.0])
    assert_allclose(np.rad2deg(turned[[200, 400, 600, 800, 1000]]), [0.0, 180.0, 180.0, 0.0, 0.0], atol=1e-9)
    assert_allclose(np.unique(np.abs(plan.turn_rate)), [0.0, np.deg2rad(9.0)])


def test_multisine_has_peak_and_lines_of_settings(experiment_with):
    settings = experiment_with(
        "manoeuvre.excitation.rudder={amplitude: 8 deg, lowest: 0.1 Hz, highest: 0.5 Hz, lines: 5}"
    ).manoeuvre.excitation.rudder
    time = np.arange(5000) / 50.0
    signal = multisine(settings, time)
    assert np.abs(signal).max() == pytest.approx(np.deg2rad(8.0), rel=1e-12)
    amplitude = 2.0 * np.abs(np.fft.rfft(signal)) / time.size
    lines = np.flatnonzero(amplitude > 1e-6)
    assert_allclose(lines / 100.0, [0.1, 0.2, 0.3, 0.4, 0.5])
    assert_allclose(amplitude[lines], amplitude[lines[0]], rtol=1e-9)
    # Five sines without phases would have a peak of 5 times one sine.
    assert np.abs(signal).max() < 4.0 * amplitude[lines[0]]


def test_a_single_line_is_a_sine(experiment_with):
    settings = experiment_with(
        "manoeuvre.excitation.elevator={amplitude: 0.1, lowest: 0.25 Hz, lines: 1, phase: 30 deg}"
    ).manoeuvre.excitation.elevator
    time = np.arange(4001) / 100.0
    peak = np.abs(np.sin(2 * np.pi * 0.25 * time + np.pi / 6)).max()
    assert_allclose(multisine(settings, time), 0.1 * np.sin(2 * np.pi * 0.25 * time + np.pi / 6) / peak, atol=1e-12)


def test_excitation_and_speed_fade_in(plan_of):
    excitation = "{fade_in: 10 s, rudder: {amplitude: 5 deg, lowest: 0.2 Hz, lines: 1}}"
    manoeuvre = "{type: multisine, duration: 30 s, speed: 3 m/s, initial_speed: 1 m/s, excitation: "
    plan = plan_of(f"{manoeuvre}{excitation}}}")
    assert (plan.speed[0], plan.speed[500], plan.speed[1000]) == pytest.approx((1.0, 2.0, 3.0))
    assert np.all(np.diff(plan.speed[:1000]) >= 0.0)
    assert np.all(plan.speed[1000:] == 3.0)
    full = plan_of(f"{manoeuvre}{excitation.replace('fade_in: 10 s', 'fade_in: 0 s')}}}").feedforward
    assert np.all(np.abs(plan.feedforward) <= np.abs(full) + 1e-15)
    assert_allclose(plan.feedforward[1000:], full[1000:])


def write_inputs(path, rows, header="time,rudder,elevator,surge_force,roll_moment"):
    path.write_text("\n".join([header, *(",".join(str(cell) for cell in row) for row in rows)]) + "\n")
    return f"{{type: recorded, duration: 4 s, speed: 1 m/s, input_rate: 10 Hz, file: {path}}}"


def test_recorded_inputs_are_constant_between_rows(plan_of, tmp_path):
    rows = [(0, 0.01, -0.02, 5, 0.1), (1.5, 0.03, 0.04, 6, 0.2), (3.2, 0.05, 0.06, 7, 0.3)]
    plan = plan_of(write_inputs(tmp_path / "inputs.csv", rows))
    for k, time in enumerate(plan.time):
        row = max(row for row in rows if row[0] <= time)
        assert tuple(plan.feedforward[k]) == row[1:]


def test_columns_of_recording_have_any_order(plan_of, tmp_path):
    header = "note,roll_moment,surge_force,elevator,rudder,time"
    plan = plan_of(write_inputs(tmp_path / "inputs.csv", [("x", 4, 3, 0.2, 0.1, 0), ("y", 4, 3, 0.2, 0.1, 4)], header))
    assert tuple(plan.feedforward[0]) == (0.1, 0.2, 3.0, 4.0)


GOOD = [(0, 0, 0, 0, 0), (4, 0, 0, 0, 0)]


@pytest.mark.parametrize(
    ("rows", "header", "message"),
    [
        (GOOD, "time,rudder,elevator,surge_force", "roll_moment"),
        ([], None, "at least one row"),
        ([(0, 0, 0, 0, 0), (1, 0, "left", 0, 0)], None, "line 3"),
        ([(0, 0, 0, 0, 0), (1, 0, 0)], None, "line 3"),
        ([(0, 0, 0, 0, 0), (4, 0, 5, 0, 0, 0)], None, "line 3: 6 cells; expected 5"),
        ([(0, 0, 0, 0, 0), (4, 0, "5_0", 0, 0)], None, "line 3: '5_0' is not a finite number"),
        ([(0, 0, 0, 0, 0), (4, 0, "\u0665", 0, 0)], None, "line 3: '\u0665' is not a finite number"),
        ([(0, 0, 0, 0, 0), (4, 0, "9" * 200_000, 0, 0)], None, "line 3: field larger than field limit"),
        (GOOD, "time,rudder,elevator,surge_force,roll_moment,rudder", "no or several columns rudder"),
        ([(0, 0, 0, 0, 0), (4, "nan", 0, 0, 0)], None, "finite"),
        ([(0, 0, 0, 0, 0), (2, 0, 0, 0, 0), (1, 0, 0, 0, 0)], None, "increasing"),
        ([(0, 0, 0, 0, 0), (0, 0, 0, 0, 0)], None, "increasing"),
        ([(1, 0, 0, 0, 0), (4, 0, 0, 0, 0)], None, "manoeuvre needs"),
        ([(0, 0, 0, 0, 0), (2, 0, 0, 0, 0)], None, "manoeuvre needs"),
    ],
    ids=[
        "column",
        "empty",
        "word",
        "short row",
        "decimal comma",
        "underscore",
        "other digit",
        "long cell",
        "twice a column",
        "nan",
        "backwards",
        "twice",
        "starts late",
        "ends early",
    ],
)
def test_invalid_recording_gives_one_line_message(rows, header, message, plan_of, tmp_path):
    path = tmp_path / "inputs.csv"
    manoeuvre = write_inputs(path, rows, header) if header else write_inputs(path, rows)
    with pytest.raises(ConfigError, match=message) as caught:
        plan_of(manoeuvre)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_byte_order_mark_is_ignored(plan_of, tmp_path):
    assert plan_of(write_inputs(tmp_path / "inputs.csv", GOOD, "\ufefftime,rudder,elevator,surge_force,roll_moment"))


def test_pipe_as_recording_raises(plan_of, tmp_path):
    os.mkfifo(tmp_path / "inputs.csv")
    with pytest.raises(ConfigError, match="pipe or a device"):
        plan_of(f"{{type: recorded, duration: 4 s, speed: 1 m/s, file: {tmp_path / 'inputs.csv'}}}")


@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe\x00time", b"time\x00,rudder\n"])
def test_unreadable_recording_gives_one_line_message(content, plan_of, tmp_path):
    path = tmp_path / "inputs.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        plan_of(f"{{type: recorded, duration: 4 s, speed: 1 m/s, file: {path}}}")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_replayed_inputs_reproduce_the_run(fly, tmp_path):
    original = fly(None, "manoeuvre.duration=20 s", "manoeuvre.initial_speed=2 m/s")
    path = tmp_path / "inputs.csv"
    table = np.column_stack([original.time, original.inputs])
    np.savetxt(
        path, table, delimiter=",", fmt="%.17g", header="time,rudder,elevator,surge_force,roll_moment", comments=""
    )
    limits = "limits: {fin_angle: 25 deg, fin_rate: 60 deg/s}"
    replayed = fly(f"{{type: recorded, duration: 20 s, speed: 2 m/s, file: {path}, {limits}}}")
    assert_allclose(replayed.inputs, original.inputs, atol=1e-12)
    assert_allclose(replayed.motion, original.motion, atol=1e-9)


ORTHOGONAL = (
    "{type: multisine, duration: 64 s, speed: 1 m/s, input_rate: 20 Hz, excitation: {orthogonal: true, "
    "rudder: {amplitude: 8 deg, lowest: 0.05 Hz, highest: 0.6 Hz, lines: 7}, "
    "elevator: {amplitude: 5 deg, lowest: 0.1 Hz, highest: 0.8 Hz, lines: 40}, "
    "surge_force: {amplitude: 3 N, lowest: 0.02 Hz, highest: 0.2 Hz}}}"
)


def test_orthogonal_multisines_are_orthogonal_and_start_and_end_at_zero(plan_of):
    signals = plan_of(ORTHOGONAL).feedforward[:, :3]
    peak = np.abs(signals).max(axis=0)
    assert_allclose(peak, [np.deg2rad(8.0), np.deg2rad(5.0), 3.0], rtol=1e-12)
    assert np.abs(signals[[0, -1]] / peak).max() < 1e-9
    products = signals[:-1].T @ signals[:-1]
    size = np.sqrt(np.diagonal(products))
    assert np.abs(products / np.outer(size, size) - np.eye(3)).max() < 1e-9
    lines = [np.flatnonzero(np.abs(np.fft.rfft(column[:-1])) > 1e-6) for column in signals.T]
    assert [line.size for line in lines] == [7, 15, 4]
    for line, low, high in zip(lines, (0.05, 0.1, 0.02), (0.6, 0.8, 0.2), strict=True):
        assert low - 1e-9 <= line[0] / 64.0 <= line[-1] / 64.0 <= high + 1e-9


def test_narrow_band_of_orthogonal_multisine_raises(plan_of):
    with pytest.raises(ConfigError, match=r"expected highest at least 0\.0469 Hz above lowest"):
        plan_of(ORTHOGONAL.replace("highest: 0.2 Hz", "highest: 0.06 Hz"))
