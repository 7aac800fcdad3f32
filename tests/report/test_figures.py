from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from auvid_cli.errors import FileError
from auvid_cli.report.figures import canvas
from auvid_cli.report.figures.coefficients import coefficient_figure
from auvid_cli.report.figures.draw import FigureQueue
from auvid_cli.report.figures.limits import around, value_range, with_margin, with_near_zero
from auvid_cli.report.figures.motion import motion_figure
from auvid_cli.report.figures.path import path_figure
from auvid_cli.report.figures.series import spaced, thin, unwrapped
from auvid_cli.report.figures.style import new_figure, plain_log_ticks
from auvid_cli.report.write import write_tables
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.parameters import MOTION

from .conftest import TIME, diverged, evaluation_of, make_estimate

ALL = {
    *("path", "velocities", "attitude", "coefficients_damping", "coefficients_lift", "coefficients_control"),
    *("innovations_ckf", "innovations_tukf"),
}
# One of each group, where a panel like the others would show nothing more.
FEW = tuple({c.group: c.symbol for c in reversed(COEFFICIENTS)}.values())[::-1]


@pytest.fixture
def as_png_only(monkeypatch):
    """Every figure is drawn once, not twice, coarsely, and its panels stand where they stand."""
    print_png = canvas.FigureCanvasAgg.print_png

    def without_layout(self, path, **options):
        self.figure.set_layout_engine("none")
        self.figure.set_dpi(20)
        print_png(self, path, **options)

    monkeypatch.setattr(canvas.FigureCanvasAgg, "print_png", without_layout)
    monkeypatch.setattr(canvas.FigureCanvasSVG, "print_svg", lambda self, path, **options: path.write_text("<svg/>"))


@pytest.fixture(scope="module")
def draw_figures():
    """Function: draw all figures in this process, where faults can be provoked."""
    with ThreadPoolExecutor(1) as executor:

        def draw(dataset, estimates, evaluation, folder):
            figures = FigureQueue(folder, executor.submit)
            for estimate in estimates:
                figures.add_innovations(estimate)
            figures.add_others(dataset, estimates, evaluation)
            return figures.finish()

        yield draw


def check(paths, folder, stems):
    assert {path.name for path in paths} == {path.name for path in folder.iterdir()}
    assert {path.stem for path in paths} == stems
    for path in paths:
        if path.suffix == ".png":
            assert path.read_bytes().startswith(b"\x89PNG")
        else:
            assert ElementTree.parse(path).getroot().tag.endswith("svg")
        assert 3_000 < path.stat().st_size < 1_000_000


def test_figures_of_many_panels_are_drawn_first(tmp_path, dataset, estimates, evaluation):
    handed_out = []

    def submit(function, kind, arguments, folder, name):
        handed_out.append(name)

    FigureQueue(tmp_path, submit).add_others(dataset, estimates, evaluation)
    shared = ["velocities", "coefficients_damping", "coefficients_lift", "attitude", "coefficients_control"]
    assert handed_out == [*shared, "path"]


def test_the_whole_report(tmp_path, dataset, draw_figures):
    estimates = [make_estimate(name, FEW) for name in ("ckf", "tukf")]
    evaluation = evaluation_of(dataset, estimates)
    assert {path.parent for path in write_tables(evaluation, tmp_path / "tables")} == {tmp_path / "tables"}
    check(draw_figures(dataset, estimates, evaluation, tmp_path / "figures"), tmp_path / "figures", ALL)


@pytest.mark.usefixtures("as_png_only")
def test_a_single_filter_with_a_few_coefficients_and_no_truth(tmp_path, dataset, draw_figures):
    estimate = make_estimate("ukf", symbols=("X_u|u|", "Y_uvl", "N_uvl"))
    dataset = dataset.without_truth()
    paths = draw_figures(dataset, [estimate], evaluation_of(dataset, [estimate]), tmp_path)
    coefficients = {"coefficients_damping", "coefficients_lift"}
    assert {path.stem for path in paths} == {"path", "velocities", "attitude", *coefficients, "innovations_ukf"}


@pytest.mark.usefixtures("as_png_only")
@pytest.mark.parametrize(("samples", "others"), [(1, []), (40, ["ckf"])])
def test_diverged_filters_are_drawn_as_far_as_they_went(tmp_path, dataset, samples, others, draw_figures):
    broken = diverged(make_estimate("ekf", FEW[:1]), samples)
    broken.mean[-1] = np.nan
    estimates = [broken, *(make_estimate(name, FEW[:1]) for name in others)]
    dataset = dataset.without_truth()
    paths = draw_figures(dataset, estimates, evaluation_of(dataset, estimates, blown_up=("ekf",)), tmp_path)
    assert len(paths) == 2 * (4 + len(estimates))


@pytest.mark.usefixtures("as_png_only")
def test_a_coefficient_that_is_infinitely_uncertain_is_drawn_and_printed(tmp_path, dataset):
    estimate = make_estimate("output_error", FEW)
    estimate.standard_deviation[:, 0] = np.inf
    evaluation = evaluation_of(dataset, [estimate])
    figure = coefficient_figure(COEFFICIENTS[:1], [estimate.course(FEW)], {"X_u|u|": 10.0})
    assert len(canvas.save(figure, tmp_path / "figures", "damping")) == 2
    write_tables(evaluation, tmp_path)
    assert "output_error,X_u|u|,kg/m,10.0,10.1,inf," in (tmp_path / "coefficients.csv").read_text(encoding="utf-8")
    assert "| 10.10 ± — † |" in (tmp_path / "tables.md").read_text(encoding="utf-8")


@pytest.mark.usefixtures("as_png_only")
def test_missing_sensors_and_no_filter(tmp_path, dataset, draw_figures):
    bare = replace(dataset, sensors={"gyroscope": dataset.sensors["gyroscope"]})
    assert {path.stem for path in draw_figures(bare, [], evaluation_of(bare, []), tmp_path)} == {
        *("path", "velocities", "attitude")
    }


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_a_figure_that_fails_leaves_no_half_file_and_the_earlier_one(tmp_path, monkeypatch, kind):
    folder = tmp_path / "figures"
    before = {path: path.read_bytes() for path in canvas.save(Figure(), folder, "path")}

    def fail(self, filename, **options):
        filename.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    name = {"png": "FigureCanvasAgg", "svg": "FigureCanvasSVG"}[kind]
    monkeypatch.setattr(getattr(canvas, name), f"print_{kind}", fail)
    with pytest.raises(FileError, match="No space left"):
        canvas.save(Figure(), folder, "path")
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_the_transient_does_not_squash_the_panel(estimates):
    estimates[0].mean[:50, 0] = 1e6
    axes = coefficient_figure(COEFFICIENTS[:1], estimates, {"X_u|u|": 10.0}).axes[0]
    low, high = axes.get_ylim()
    assert 8.0 < low < 9.6 < 10.7 < high < 12.0


def test_attitude_is_in_degrees_and_unwrapped(dataset, evaluation):
    figure = motion_figure(MOTION[6:], dataset.sensors, evaluation.free_runs)
    heading = figure.axes[4]
    assert "deg" in heading.get_ylabel()
    measured = heading.lines[0].get_ydata()
    assert np.nanmax(measured) == pytest.approx(np.rad2deg(0.1 * TIME[-1]), abs=5.0)


def test_a_free_run_that_blows_up_leaves_the_measurement_readable(dataset, estimates):
    evaluation = evaluation_of(dataset, estimates, blown_up=("ekf", "ckf", "tukf"))
    axes = motion_figure(MOTION[:1], dataset.sensors, evaluation.free_runs).axes[0]
    low, high = axes.get_ylim()
    assert high - low < 10.0


def test_without_a_measurement_the_sound_free_run_sets_the_scale(dataset, estimates):
    evaluation = evaluation_of(dataset, estimates, blown_up=("ekf",))
    axes = motion_figure(MOTION[:1], {}, evaluation.free_runs).axes[0]
    low, high = axes.get_ylim()
    assert high - low < 10.0


def test_depth_increases_downwards_and_the_map_is_to_scale(dataset):
    space, plan, profile = path_figure(dataset.truth, []).axes
    assert np.diff(space.get_zlim()) < 0.0
    assert np.diff(profile.get_ylim()) < 0.0
    assert plan.get_aspect() == 1.0
    assert np.diff(space.get_xlim()) == pytest.approx(np.diff(space.get_ylim()))


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


def test_limits():
    assert value_range(np.array([np.nan, np.inf])) is None
    assert value_range(np.array([1.0, np.nan]), np.array([-2.0])) == (-2.0, 1.0)
    assert with_margin(3.0, 3.0) == pytest.approx((2.85, 3.15))
    assert with_margin(0.0, 0.0) == (-1.0, 1.0)
    assert with_near_zero(1.0, 11.0) == (0.0, 11.0)
    assert with_near_zero(5.0, 6.0) == (5.0, 6.0)
    assert with_near_zero(-11.0, -1.0) == (-11.0, 0.0)
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
