"""The timeline of an inspection shows what was found, of a minute and of ten hours."""

import numpy as np
import pytest
from matplotlib.collections import PatchCollection

from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.inspection.inspection import Inspection, Mark
from auvid_cli.report.figures.timeline import timeline_figure
from auvid_cli.vehicle.parameters import INPUTS

SENSOR_TIME = np.linspace(0.0, 60.0, 50)
SENSORS = {
    "dvl": SensorRecord(SENSOR_TIME, np.stack([SENSOR_TIME, -SENSOR_TIME, np.full(50, np.nan)], axis=1), np.ones(3)),
    "depth": SensorRecord(SENSOR_TIME, np.sqrt(SENSOR_TIME)[:, None], np.ones(1)),
}


def inspection_of(span, marks):
    time = np.linspace(0.0, span, 50_000)
    inputs = InputRecord(time, np.sin(np.outer(time, [1.0, 2.0, 3.0, 4.0])))
    presence = {"dvl": np.linspace(0.0, 1.0, 60), "depth": np.ones(1)}
    return Inspection([], marks, inputs, presence, (0.0, span))


@pytest.mark.parametrize(("span", "unit", "end"), [(60.0, "s", 60.0), (3000.0, "min", 50.0), (36_000.0, "h", 10.0)])
def test_time_is_in_a_unit_that_can_be_read(span, unit, end):
    figure = timeline_figure(SENSORS, inspection_of(span, []))
    assert len(figure.axes) == len(INPUTS) + 3 + 2, "what is nowhere known is left out"
    assert figure.axes[-1].get_xlabel() == f"time ({unit})"
    assert figure.axes[-1].get_xlim() == pytest.approx((0.0, end))


def test_every_mark_stands_in_its_strip_wide_enough_to_be_seen():
    marks = [
        Mark("dvl", "spike", 100.0, 100.0),
        Mark("dvl", "spike", 5000.0, 5000.0),
        Mark("dvl", "gap", 1000.0, 2000.0),
        Mark("depth", "clock", 3000.0, 3002.0),
    ]
    figure = timeline_figure(SENSORS, inspection_of(36_000.0, marks))
    dvl, depth = figure.axes[-3], figure.axes[-1]
    widths = sorted(
        path.get_extents().width
        for collection in dvl.collections
        if isinstance(collection, PatchCollection)
        for path in collection.get_paths()
    )
    assert widths == pytest.approx([0.025, 0.025, 1000.0 / 3600.0])
    assert [text.get_text() for text in dvl.texts] == ["spikes: 2, gaps: 1"]
    assert [text.get_text() for text in depth.texts] == ["clock jumps: 1"]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["measurements present", "spikes", "clock jumps", "gaps"]


def test_ten_thousand_spikes_are_drawn_as_few_shapes():
    marks = [Mark("dvl", "spike", float(t), float(t)) for t in range(10_000)]
    figure = timeline_figure(SENSORS, inspection_of(36_000.0, marks))
    shapes = sum(len(c.get_paths()) for c in figure.axes[-3].collections if isinstance(c, PatchCollection))
    assert shapes == 1


def test_the_signals_are_drawn_in_units_that_can_be_read():
    inspection = inspection_of(60.0, [])
    rudder, *_, depth, _ = timeline_figure(SENSORS, inspection).axes
    assert rudder.get_ylabel() == "rudder (°)"
    assert np.nanmax(rudder.lines[0].get_ydata()) == pytest.approx(np.rad2deg(inspection.inputs.values[:, 0].max()))
    np.testing.assert_array_equal(depth.lines[0].get_ydata(), SENSORS["depth"].values[:, 0])
