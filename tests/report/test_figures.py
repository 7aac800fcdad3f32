from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from auvid_cli.config.enums import FigureFormat, FilterName
from auvid_cli.data.dataset import SensorRecord, TruthRecord
from auvid_cli.data.estimate import EstimateHistory
from auvid_cli.errors import FileError
from auvid_cli.evaluation.results import CLASSES, CoefficientBound, FreeRun, Identifiability
from auvid_cli.report.figures import workers
from auvid_cli.report.figures.coefficients import bounds_figure, convergence_figure, correlation_figure
from auvid_cli.report.figures.draw import FigureQueue, FreeRunRequest, MotionErrorRequest
from auvid_cli.report.figures.motion import motion_error_figure, motion_figure, path_figure
from auvid_cli.report.figures.style import new_figure, plain_log_ticks
from auvid_cli.report.figures.validation import free_run_figure, innovation_figure
from auvid_cli.report.layout import write_tables
from auvid_cli.report.plot_data import (
    around,
    convergence_plots,
    estimate_plot,
    log_spaced,
    spaced,
    thin,
    unwrapped,
    value_range,
    with_margin,
)
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.parameters import DEPTH, MOTION, MOTION_SYMBOLS

from .conftest import TIME, TRUE, diverged, evaluation_of, make_estimate, motion_at

ALL = {
    *("path", "estimates", "convergence", "motion_errors", "free_runs", "innovations"),
}
# One of each group, where a panel like the others would show nothing more.
FEW = tuple({c.group: c.symbol for c in reversed(COEFFICIENTS)}.values())[::-1]


EVERY_FORMAT = tuple(FigureFormat)
CANVASES = list(zip((FigureCanvasAgg, FigureCanvasSVG, FigureCanvasPdf), EVERY_FORMAT, strict=True))


@pytest.fixture
def coarsely(monkeypatch):
    """Every figure is drawn with few dots, and its panels stand where they stand."""
    print_png = FigureCanvasAgg.print_png

    def without_layout(self, path, **options):
        self.figure.set_layout_engine("none")
        self.figure.set_dpi(20)
        print_png(self, path, **options)

    monkeypatch.setattr(FigureCanvasAgg, "print_png", without_layout)


@pytest.fixture
def identifiability():
    """Bounds over nine decades, whose errors do not go together."""
    labels = [label for _, label in CLASSES]
    bounds = [
        CoefficientBound(name, "kg/m", 1.0, 0.01 * percent, percent, np.nan, label, "dvl", 0.75, "")
        for name, percent, label in zip(TRUE, (1e-5, 2.0, 10.0, 1e4), labels, strict=False)
    ]
    growth = [(duration, np.ones(len(bounds)) / duration) for duration in (1.0, 8.0)]
    return Identifiability(bounds, [], {}, np.eye(len(bounds)), growth, {})


@pytest.fixture(scope="module")
def draw_figures():
    """Function: draw all figures in this process, where faults can be provoked."""
    with ThreadPoolExecutor(1) as executor:

        def draw(dataset, estimates, evaluation, folder, formats=(FigureFormat.PNG,)):
            figures = FigureQueue(folder, executor.submit, formats)
            figures.add_estimates(dataset, estimates)
            figures.add_free_runs(dataset, evaluation)
            return figures.finish()

        yield draw


def check(paths, folder, stems):
    assert {path.name for path in paths} == {path.name for path in folder.iterdir()}
    assert {path.name for path in paths} == {f"{stem}.png" for stem in stems}
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG")
        assert 3_000 < path.stat().st_size < 1_000_000


@pytest.mark.slow
def test_the_whole_report(tmp_path, dataset, draw_figures):
    estimates = [make_estimate(name, FEW) for name in ("ckf", "tukf")]
    evaluation = evaluation_of(dataset, estimates)
    assert {path.parent for path in write_tables(evaluation, tmp_path / "tables")} == {tmp_path / "tables"}
    check(draw_figures(dataset, estimates, evaluation, tmp_path / "figures"), tmp_path / "figures", ALL)


@pytest.mark.slow
@pytest.mark.usefixtures("coarsely")
def test_a_single_filter_with_a_few_coefficients_and_no_truth(tmp_path, dataset, draw_figures):
    estimate = make_estimate("ukf", symbols=("X_u|u|", "Y_uvl", "N_uvl"))
    dataset = dataset.without_truth()
    paths = draw_figures(dataset, [estimate], evaluation_of(dataset, [estimate]), tmp_path)
    assert {path.stem for path in paths} == {"path", "estimates", "convergence", "free_runs", "innovations"}


@pytest.mark.slow
@pytest.mark.usefixtures("coarsely")
@pytest.mark.parametrize(("samples", "others"), [(1, []), (40, ["ckf"])])
def test_diverged_filters_are_drawn_as_far_as_they_went(tmp_path, dataset, samples, others, draw_figures):
    broken = diverged(make_estimate("ekf", FEW[:1]), samples)
    broken.mean[-1] = np.nan
    estimates = [broken, *(make_estimate(name, FEW[:1]) for name in others)]
    dataset = dataset.without_truth()
    paths = draw_figures(dataset, estimates, evaluation_of(dataset, estimates, blown_up=("ekf",)), tmp_path)
    assert len(paths) == 5


@pytest.mark.usefixtures("coarsely")
def test_a_coefficient_that_is_infinitely_uncertain_is_drawn_and_printed(tmp_path, dataset):
    estimate = make_estimate("output_error", FEW)
    estimate.standard_deviation[:, 0] = np.inf
    evaluation = evaluation_of(dataset, [estimate])
    figure = convergence_figure(convergence_plots(FEW[:1], [estimate.history(FEW)], {"X_u|u|": 10.0}))
    assert len(workers.save(figure, tmp_path / "figures", "convergence", EVERY_FORMAT[:1])) == 1
    write_tables(evaluation, tmp_path)
    assert "output_error,X_u|u|,kg/m,10.0,10.1,inf," in (tmp_path / "coefficients.csv").read_text(encoding="utf-8")
    assert "| 10.10 ± — † |" in (tmp_path / "tables.md").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("coarsely")
def test_missing_sensors_and_no_filter(tmp_path, dataset, draw_figures):
    bare = replace(dataset, sensors={"gyroscope": dataset.sensors["gyroscope"]})
    assert {path.stem for path in draw_figures(bare, [], evaluation_of(bare, []), tmp_path)} == {"path"}


@pytest.mark.parametrize(("canvas_class", "form"), CANVASES)
def test_a_figure_that_fails_leaves_no_half_file_and_the_earlier_one(tmp_path, monkeypatch, canvas_class, form):
    folder = tmp_path / "figures"
    before = {path: path.read_bytes() for path in workers.save(Figure(), folder, "path", EVERY_FORMAT)}

    def fail(self, filename, **options):
        filename.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(canvas_class, f"print_{form}", fail)
    with pytest.raises(FileError, match="No space left"):
        workers.save(Figure(), folder, "path", EVERY_FORMAT)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.slow
def test_each_format_is_what_it_is_called(tmp_path, dataset):
    png, svg, pdf = workers.save(free_run_figure(dataset.sensors, {}), tmp_path, "free_runs", EVERY_FORMAT)
    assert png.read_bytes().startswith(b"\x89PNG")
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    assert pdf.read_bytes().startswith(b"%PDF")


def test_a_figure_that_is_drawn_again_leaves_no_earlier_one_in_another_format(tmp_path):
    workers.save(Figure(), tmp_path, "path", EVERY_FORMAT)
    workers.save(Figure(), tmp_path, "path", (FigureFormat.SVG,))
    assert [path.name for path in tmp_path.iterdir()] == ["path.svg"]


def inches_beyond(figure):
    """How far a figure's drawing reaches over its edge, inches."""
    FigureCanvasAgg(figure)
    figure.set_dpi(30)
    figure.draw_without_rendering()
    drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    return max(-drawn.x0, -drawn.y0, drawn.x1 - width, drawn.y1 - height)


@pytest.mark.slow
def test_margins_have_room_for_what_stands_in_them(dataset):
    names = [name.value for name in FilterName]
    estimates = [make_estimate(name) for name in names]
    motions = [estimate.history(MOTION_SYMBOLS) for estimate in estimates]
    # Numbers with as many digits as there are.
    long = replace(dataset.truth, motion=dataset.truth.motion + 1.23e-7 * np.arange(9))
    runs = {name: FreeRun(TIME, long.motion) for name in names}
    for figure in (
        convergence_figure(
            convergence_plots([c.symbol for c in COEFFICIENTS], [e.history(tuple(TRUE)) for e in estimates], TRUE)
        ),
        motion_error_figure(long, motions),
        free_run_figure(dataset.sensors, runs),
        path_figure(long, motions),
        innovation_figure({name: make_estimate(name).innovations for name in names}),
    ):
        assert inches_beyond(figure) < 0.02


def test_percents_are_of_the_truth_or_else_of_the_final_value():
    symbol = "X_u|u|"
    courses = [make_estimate("ckf", offset=0.01).history((symbol,))]
    of_truth = convergence_figure(convergence_plots([symbol], courses, {symbol: 10.0})).axes[0].lines[0].get_ydata()
    assert of_truth[-1] == pytest.approx(1.0, rel=1e-3), "1 % above the truth, as they are made"
    for true in ({}, {symbol: 0.0}):
        of_end = convergence_figure(convergence_plots([symbol], courses, true)).axes[0].lines[0].get_ydata()
        assert of_end[0] == pytest.approx(100.0)
        assert of_end[10] == pytest.approx(100.0 * np.exp(-TIME[30]), rel=1e-3), "the greatest of each three"


def test_bands_set_the_scale_of_convergence_and_the_transient_does_not(estimates):
    estimates[0].mean[:50, 0] = 1e9
    plots = convergence_plots(["X_u|u|"], [estimates[0].history(FEW)], {"X_u|u|": 10.0})
    low, high = convergence_figure(plots).axes[0].get_ylim()
    # Twice .25 of 10.
    assert low < 5.0 <= high <= 1000.0


def test_errors_of_the_motion_are_estimates_minus_the_truth(dataset):
    estimate = make_estimate("ckf")
    estimate.mean[:, -1] += 2.0 * np.pi + 0.01
    figure = motion_error_figure(dataset.truth, [estimate.history(MOTION_SYMBOLS)])
    surge, *_, heading = figure.axes
    np.testing.assert_allclose(surge.lines[0].get_ydata(), 0.0, atol=1e-12)
    np.testing.assert_allclose(heading.lines[0].get_ydata(), np.rad2deg(0.01), atol=1e-9)
    assert [text.get_text() for text in heading.texts] == [r"$\psi$ (°)"]


@pytest.mark.slow
def test_numbers_at_one_panel_do_not_reach_into_its_neighbour(dataset):
    estimate = make_estimate("ckf")
    columns = [estimate.state.index(symbol) for symbol in MOTION_SYMBOLS]
    # As small as on the default run, where numbers are longest.
    estimate.mean[:, columns] = motion_at(TIME) + 1.4e-4
    estimate.standard_deviation[:, columns] = 7e-5
    figure = motion_error_figure(dataset.truth, [estimate.history(MOTION_SYMBOLS)])
    renderer = FigureCanvasAgg(figure).get_renderer()
    for left, right in pairwise(figure.axes):
        numbers = [label.get_window_extent(renderer) for label in right.get_yticklabels()]
        if right.get_position().x0 > left.get_position().x0:
            assert min(extent.x0 for extent in numbers) > left.get_window_extent(renderer).x1


def test_signs_of_correlations_are_told_without_colour(identifiability):
    correlation = identifiability.correlation
    correlation[0, 1] = correlation[1, 0] = -0.08
    texts = correlation_figure(identifiability).axes[0].texts
    assert [(text.get_text(), text.get_position()) for text in texts] == [("-0.08", (1, 0)), ("-0.08", (0, 1))]


@pytest.mark.slow
def test_limits_of_classes_are_named(identifiability):
    figure = bounds_figure(identifiability)
    bars = figure.axes[0]
    assert [text.get_text() for text in bars.texts] == ["1 %", "5 %", "20 %"]
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    extents = [text.get_window_extent(renderer) for text in bars.texts]
    assert all(left.x1 < right.x0 for left, right in pairwise(extents))


def test_durations_are_labelled_with_plain_numbers(identifiability):
    percent = identifiability.growth[0][1]
    figure = bounds_figure(identifiability._replace(growth=[(time, percent) for time in (2.5, 50.05, 3600.0)]))
    assert [label.get_text() for label in figure.axes[1].get_xticklabels()] == ["3600", "50", "2.5"]


def test_means_of_free_run_residuals_are_within_the_noise_where_the_model_is_right(dataset):
    figure = free_run_figure(dataset.sensors, {"ckf": FreeRun(TIME, motion_at(TIME))})
    assert len(figure.axes) == 9
    rate = figure.axes[3]
    assert "°/s" in rate.texts[0].get_text()
    mean = rate.lines[0].get_ydata()
    # Of .01 rad/s, of three or four samples each.
    assert 0.3 < np.nanstd(mean) / np.rad2deg(0.01 / np.sqrt(401 / 120)) < 1.5


def test_a_free_run_that_blows_up_leaves_the_measurement_readable(dataset, estimates):
    evaluation = evaluation_of(dataset, estimates, blown_up=("ekf", "ckf", "tukf"))
    axes = free_run_figure(dataset.sensors, evaluation.free_runs).axes[0]
    low, high = axes.get_ylim()
    assert high - low < 10.0


def test_densities_hold_all_innovations_and_say_how_many_are_within():
    innovations = make_estimate("ckf").innovations
    innovations["dvl"].innovation[7, 0] = 1.0
    axes = innovation_figure({"ckf": innovations}).axes[0]
    sizes = [image.get_array().sum() for image in axes.images]
    assert len(sizes) == 9
    of_dvl = list(innovations).index("dvl") * 3
    assert sizes[of_dvl] == 400, "one lies a hundred standard deviations off"
    within = 100.0 * (np.abs(innovations["dvl"].innovation[:, 0]) <= 0.02).mean()
    assert axes.texts[of_dvl].get_text() == f"{within:.1f} % within, 1 beyond 4 sd"


def test_attitude_is_in_degrees_and_unwrapped(dataset, evaluation):
    figure = motion_figure(MOTION[6:], dataset.sensors, evaluation.free_runs)
    heading = figure.axes[4]
    assert "°" in heading.get_ylabel()
    measured = heading.lines[0].get_ydata()
    assert np.nanmax(measured) == pytest.approx(np.rad2deg(0.1 * TIME[-1]), abs=5.0)


def test_component_measured_in_few_rows_of_a_long_record_is_drawn(dataset, estimates, tmp_path):
    size = 250_000
    values = np.zeros((size, 3))
    values[:, 2] = np.nan
    # Rows that every third row, from the first, leaves out.
    values[1::30, 2] = 0.1
    sensors = {"gyroscope": SensorRecord(np.linspace(0.0, TIME[-1], size), values, np.full(3, 0.01))}
    requests = []

    def submit(work, request, *rest):
        requests.append(request)
        return Future()

    evaluation = evaluation_of(dataset, estimates)
    FigureQueue(tmp_path, submit, EVERY_FORMAT).add_free_runs(replace(dataset, sensors=sensors), evaluation)
    (drawn,) = (request for request in requests if isinstance(request, FreeRunRequest))
    assert np.isfinite(drawn.sensors["gyroscope"].values[:, 2]).any()


def test_truth_of_a_long_run_is_sent_where_the_estimates_are(dataset, estimates, tmp_path):
    size = 300_000
    time = np.linspace(0.0, TIME[-1], size)
    motion = np.sin(np.outer(300.0 * time, np.arange(1.0, 10.0)))
    truth = TruthRecord(time, motion, np.zeros((size, 3)), TRUE)
    requests = []

    def submit(work, request, *rest):
        requests.append(request)
        return Future()

    FigureQueue(tmp_path, submit, EVERY_FORMAT).add_estimates(replace(dataset, truth=truth), estimates)
    (drawn,) = (request for request in requests if isinstance(request, MotionErrorRequest))
    assert drawn.truth.time.size < 0.5 * size
    for estimate in estimates:
        shown = np.interp(estimate.time, drawn.truth.time, drawn.truth.motion[:, 8])
        np.testing.assert_array_equal(shown, np.interp(estimate.time, time, motion[:, 8]))


def test_heading_of_a_compass_is_no_missing_measurement(dataset, estimates):
    compass = {"magnetometer": SensorRecord(TIME, np.full((TIME.size, 1), 0.1), np.array([0.01]))}
    figure = motion_figure(MOTION[8:], compass, evaluation_of(dataset, estimates).free_runs)
    assert not [text for text in figure.axes[0].texts if text.get_text() == "not measured"]


def test_yaw_rate_of_a_validation_without_gyroscope_is_that_of_the_attitude(dataset, estimates, tmp_path):
    time = np.arange(0.0, TIME[-1], 0.1)
    angles = np.column_stack([np.zeros((time.size, 2)), 0.05 * time])  # a turn of 0.05 rad/s
    attitude = SensorRecord(time, angles, np.full(3, 0.01))
    run = evaluation_of(dataset, estimates).free_runs["ekf"]
    shown = replace(dataset, sensors={"attitude": attitude})
    validation = SimpleNamespace(shown=shown, run=run, filter="ekf", predictions=[])
    requests = []

    def submit(work, request, *rest):
        requests.append(request)
        return Future()

    FigureQueue(tmp_path, submit, EVERY_FORMAT).add_validation(validation)
    velocities = requests[0]
    rates = velocities.sensors["gyroscope"].values
    np.testing.assert_allclose(rates[:, 2], 0.05, atol=1e-9)
    assert np.isnan(rates[:, :2]).all()


def test_without_a_measurement_the_sound_free_run_sets_the_scale(dataset, estimates):
    evaluation = evaluation_of(dataset, estimates, blown_up=("ekf",))
    axes = motion_figure(MOTION[:1], {}, evaluation.free_runs).axes[0]
    low, high = axes.get_ylim()
    assert high - low < 10.0


def test_depth_increases_downwards_and_the_map_is_to_scale(dataset):
    space, plan, profile, distance = path_figure(dataset.truth, [make_estimate("ckf").history(MOTION_SYMBOLS)]).axes
    assert np.diff(space.get_zlim()) < 0.0
    assert np.diff(profile.get_ylim()) < 0.0
    assert plan.get_aspect() == 1.0
    assert len(plan.lines) == 2 * 3, "two paths, each with its ends"
    assert distance.get_yscale() == "log"
    assert np.diff(space.get_xlim()) == pytest.approx(np.diff(space.get_ylim()))


def test_caption_of_the_path_says_whether_the_depth_is_estimated(dataset):
    history = make_estimate("ckf").history(MOTION_SYMBOLS)
    depth = np.zeros((history.time.size, 1))
    columns = {name: np.hstack([getattr(history, name), depth]) for name in ("mean", "standard_deviation")}
    deeper = replace(history, state=(*history.state, DEPTH.symbol), **columns)
    for each, words in ((history, "estimates: dead reckoning"), (deeper, "estimates: depth as estimated")):
        (caption,) = path_figure(dataset.truth, [each]).axes[0].texts
        assert words in caption.get_text()


def test_thinning_keeps_extremes_ends_and_gaps():
    time = np.arange(100_000.0)
    values = np.sin(time)
    values[777], values[50_000:60_000] = 50.0, np.nan
    values[123] = np.inf
    some_time, some = thin(time, values, 1000)
    assert some.size <= 1002
    assert np.nanmax(some) == 50.0
    assert (some_time[0], some_time[-1]) == (0.0, 99_999.0)
    assert np.isnan(some[(some_time > 50_500) & (some_time < 59_500)]).all()
    assert not np.isinf(some).any()
    assert thin(time[:10], time[:10], 20)[0].size == 10
    assert spaced(1, 5).tolist() == [0]
    assert spaced(0, 5).size == 0
    assert spaced(100, 3).tolist() == [0, 49, 99]


def test_unwrapping_passes_over_gaps():
    angle = (np.linspace(0.0, 12.0, 50) + np.pi) % (2 * np.pi) - np.pi
    angle[20:22] = np.nan
    result = unwrapped(angle)
    assert np.isnan(result[20:22]).all()
    assert result[-1] == pytest.approx(12.0)


def test_limits_of_axes_ignore_what_is_not_finite_and_have_a_margin():
    assert value_range(np.array([np.nan, np.inf])) is None
    assert value_range(np.array([1.0, np.nan]), np.array([-2.0])) == (-2.0, 1.0)
    assert with_margin(3.0, 3.0) == pytest.approx((2.85, 3.15))
    assert with_margin(0.0, 0.0) == (-1.0, 1.0)
    assert around(None, None) == (-1.0, 1.0)
    assert around((0.0, 1.0), (-100.0, 1.5)) == with_margin(-1.0, 1.5)


@pytest.mark.parametrize(("low", "high"), [(15.0, 19.0), (30.0, 300.0), (0.1, 2000.0)])
def test_a_logarithmic_axis_has_numbers_however_little_it_spans(low, high):
    axes = new_figure(5.0, 3.0).subplots()
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    plain_log_ticks(axes.yaxis)
    axes.figure.canvas.draw()
    said = [label.get_text() for label in axes.get_yticklabels() if low <= label.get_position()[1] <= high]
    assert 2 <= len(said) <= 15
    assert [float(text) for text in said] == sorted(float(text) for text in said)


def test_log_spaced_samples_begin_and_end_where_asked():
    time = np.arange(0.0, 300.01, 0.01)
    some = log_spaced(time, 0.3, 200)
    assert time[some[0]] == pytest.approx(0.3)
    assert some[-1] == time.size - 1
    ratios = time[some[1:]] / time[some[:-1]]
    assert ratios.max() == pytest.approx(1000.0 ** (1 / 199), abs=0.035)
    assert log_spaced(np.zeros(1), 0.3, 200).tolist() == [0]


def test_limits_of_estimates_contain_truth_start_and_end_without_brief_excursions():
    mean = np.concatenate([[0.0], np.full(5, 1e6), np.full(994, -3.0)])[:, None]
    time = np.arange(1000.0)
    history = EstimateHistory(time, mean, np.ones_like(mean), {}, "ekf", ("X_u|u|",), True)
    assert estimate_plot("X_u|u|", [history], -3.5, 300).limits == with_margin(-3.5, 0.0)
    diverged = replace(history, mean=np.full_like(mean, 1e6), completed=False)
    assert estimate_plot("X_u|u|", [history, diverged], -3.5, 300).limits == with_margin(-3.5, 0.0)
    unknown = replace(history, mean=np.full_like(mean, np.nan))
    assert estimate_plot("X_u|u|", [unknown], None, 300).limits is None
