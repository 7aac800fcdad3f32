"""Plan of a campaign: runs, data, and assumptions of the filters."""

import json
from statistics import mean, stdev

import pytest

from auvid_cli.campaign.plan import MAX_GROUP
from auvid_cli.config.campaign import dump_campaign, load_campaign
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import validated
from auvid_cli.errors import ConfigError

GRID = """\
name: grid
settings: {manoeuvre.duration: 5 s}
seeds: [3, 5]
filters:
  - ckf
  - {name: first_order, filter: ekf, settings: {identification.ekf.transition: first_order}}
vary:
  - {setting: identification.prior.factor, values: [1, 10]}
  - name: rate
    levels:
      slow: {sensors.gyroscope.rate: 10 Hz, sensors.attitude.rate: 10 Hz}
      fast: {sensors.gyroscope.rate: 100 Hz}
"""


def simulated(group):
    return Experiment.model_validate_json(group.simulated)


def assumed(group):
    return [Experiment.model_validate_json(text) for text in group.assumed]


def test_plan_has_every_combination_filter_and_seed(planned):
    plan = planned(GRID)
    runs = [(run.seed, run.filter, *run.labels.values()) for group in plan.groups() for run in group.runs]
    wanted = {
        (seed, name, factor, rate)
        for seed in (3, 5)
        for name in ("ckf", "first_order")
        for factor in (1, 10)
        for rate in ("slow", "fast")
    }
    assert len(runs) == len(wanted) == plan.n_runs
    assert set(runs) == wanted
    assert plan.columns == {"identification.prior.factor": True, "rate": False}


def test_group_has_runs_on_the_same_data_with_own_settings(planned):
    groups = list(planned(GRID).groups())
    # Two rates and two seeds make four sets of data; a prior and a filter are nothing of the data.
    assert len(groups) == 4
    for group in groups:
        data = simulated(group)
        rate = {run.labels["rate"] for run in group.runs}
        assert rate == {"slow" if data.sensors.gyroscope.rate == 10.0 else "fast"}
        assert {run.seed for run in group.runs} == {data.seed}
        for run, given in zip(group.runs, assumed(group), strict=True):
            assert given.identification.prior.factor == run.labels["identification.prior.factor"]
            assert given.sensors == data.sensors
            (name,) = given.identification.filters
            assert (name.value, given.identification.ekf.transition) == (
                ("ekf", "first_order") if run.filter == "first_order" else ("ckf", "first_order")
            )


def test_groups_are_small(planned):
    text = "name: many\nsettings: {manoeuvre.duration: 5 s}\nseeds: 1\nfilters: [ckf]\n"
    text += "vary: [{setting: identification.prior.factor, values: [1, 2, 3, 4, 5, 6, 7, 8]}]\n"
    sizes = [len(group.runs) for group in planned(text).groups()]
    assert sizes == [MAX_GROUP, 8 - MAX_GROUP]


def test_finished_runs_are_not_planned(planned):
    plan = planned(GRID)
    done = set(list(plan.labels())[::3])
    left = [run.identity for group in plan.groups(done) for run in group.runs]
    assert sorted(left) == sorted(set(plan.labels()) - done)


def test_identity_depends_on_settings_not_on_names_or_paths(planned):
    first = planned(GRID).labels()
    renamed = planned(
        GRID.replace("name: grid", "name: other").replace("first_order, filter", "euler, filter"),
        "experiment=spiral",
    )
    assert set(renamed.labels()) == set(first)
    # A level more, and the axes the other way round: what was there is still the same.
    more = planned(GRID.replace("[1, 10]", "[10, 1, 30]")).labels()
    assert set(first) < set(more)


@pytest.mark.parametrize(
    "override",
    [
        "settings={manoeuvre.duration: 6 s}",
        "settings={manoeuvre.duration: 5 s, sensors.dvl.rate: 5 Hz}",
        "settings={manoeuvre.duration: 5 s, vehicle.parameters.m: 50 kg}",
        "settings={manoeuvre.duration: 5 s, identification.integration_step: 0.01 s}",
        "seeds=[7, 8]",
    ],
)
def test_other_settings_change_the_identity(planned, override):
    assert not set(planned(GRID).labels()) & set(planned(GRID, override).labels())


def test_other_inputs_in_same_file_change_the_identity(planned, tmp_path):
    inputs = tmp_path / "inputs.csv"
    manoeuvre = f"{{type: recorded, duration: 5 s, speed: 2 m/s, file: {inputs}}}"
    text = f"name: x\nfilters: [ckf]\nsettings: {{manoeuvre: {manoeuvre}}}\n"
    inputs.write_text("time,rudder,elevator,surge_force,roll_moment\n0,0.1,0,10,0\n5,0.1,0,10,0\n")
    before = set(planned(text).labels())
    inputs.write_text("time,rudder,elevator,surge_force,roll_moment\n0,0.2,0,10,0\n5,0.2,0,10,0\n")
    assert not before & set(planned(text).labels())


def test_other_version_changes_the_identity(planned, monkeypatch):
    before = set(planned(GRID).labels())
    monkeypatch.setattr("auvid_cli.campaign.plan.__version__", "0.0.0")
    assert not before & set(planned(GRID).labels())


def test_mistake_is_found_without_resolving_all_combinations(planned, monkeypatch):
    """Two for each combination, the data and the assumptions of the filter, and one of the campaign."""
    checked = []
    monkeypatch.setattr("auvid_cli.campaign.plan.validated", lambda *some: checked.append(0) or validated(*some))
    text = "name: big\nseeds: 2\nfilters: [ckf]\nvary:\n"
    text += "".join(
        f"  - {{setting: sensors.{one}.rate, values: [1, 2, 3]}}\n" for one in ("dvl", "gyroscope", "attitude")
    )
    big = planned(text)
    assert (big.n_runs, len(checked)) == (54, 1 + 2 * 7)
    (group,) = big.examples(1)
    assert len(group.runs) == 1
    assert len(checked) == 1 + 2 * 8


def test_axes_with_the_same_setting_are_refused(planned):
    axes = "[{setting: sensors.dvl.rate, values: [1, 2]}, {name: other, levels: {a: {}, b: {sensors.dvl.rate: 5 Hz}}}]"
    with pytest.raises(ConfigError, match="two runs of the campaign are the same"):
        planned(f"name: twins\nseeds: 2\nfilters: [ckf]\nvary: {axes}\n").labels()


@pytest.mark.slow
def test_draws_are_the_same_for_all_filters_and_follow_their_distribution(planned):
    text = (
        "name: drawn\nsettings: {manoeuvre.duration: 5 s}\nseeds: 200\nfilters: [ckf, tukf]\n"
        "vary: [{setting: vehicle.parameters.m, relative: true, known: false, draw: {normal: [1, 0.02]}}]\n"
    )
    plan = planned(text)
    factors = {}
    for group in plan.groups():
        (factor,) = {run.labels["vehicle.parameters.m"] for run in group.runs}
        factors[group.runs[0].seed] = factor
        if len(factors) < 4:
            nominal = assumed(group)[0].vehicle.parameters.by_symbol()["m"]
            assert simulated(group).vehicle.parameters.by_symbol()["m"] == pytest.approx(factor * nominal)
            assert len(group.runs) == 2
    values = list(factors.values())
    # Four standard errors of 200 draws.
    assert mean(values) == pytest.approx(1.0, abs=4 * 0.02 / 200**0.5)
    assert stdev(values) == pytest.approx(0.02, rel=4 / 400**0.5)
    assert plan.fixed_columns == []
    # Another axis more does not change them.
    more = planned(
        text.replace("vary: [", "vary: [{setting: identification.prior.factor, values: [1, 3]}, "), "seeds=20"
    )
    again = {run.seed: run.labels["vehicle.parameters.m"] for group in more.groups() for run in group.runs}
    assert again == {seed: factors[seed] for seed in range(1, 21)}


def test_filters_keep_unknown_settings_of_the_experiment(planned):
    text = (
        "name: noise\nsettings: {manoeuvre.duration: 5 s}\nseeds: 1\nfilters: [ckf]\n"
        "vary: [{setting: sensors.dvl.noise, values: [0.05], known: false}]\n"
    )
    (group,) = planned(text).groups()
    assert simulated(group).sensors.dvl.noise == (0.05,)
    assert assumed(group)[0].sensors.dvl.noise != (0.05,)
    (known,) = planned(text.replace(", known: false", "")).groups()
    assert assumed(known)[0].sensors.dvl.noise == (0.05,)


def test_relative_values_multiply_each_component(planned):
    text = (
        "name: lists\nsettings: {sensors.dvl.noise: [0.01, 0.02, 0.03]}\nseeds: 1\nfilters: [ckf]\n"
        "vary: [{setting: sensors.dvl.noise, values: [2], relative: true}]\n"
    )
    (group,) = planned(text).groups()
    assert simulated(group).sensors.dvl.noise == (0.02, 0.04, 0.06)


def test_settings_as_text_are_equivalent(planned):
    for group in planned(GRID).groups():
        for text in (group.simulated, *group.assumed):
            assert Experiment.model_validate_json(json.dumps(json.loads(text))) == Experiment.model_validate_json(text)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            ("[1, 10]", "[1, -3]"),
            r"campaign\.yaml:8:\d+: identification\.prior\.factor: must be at least 1e-06, got -3",
        ),
        (("gyroscope.rate: 10 Hz", "gyroscop.rate: 10 Hz"), r"campaign\.yaml:11:\d+: .*gyroscop.*did you mean"),
        (("rate: 100 Hz", "rate: 100 kg"), r"campaign\.yaml:12:\d+: sensors\.gyroscope\.rate: expected a frequency"),
        (("filter: ekf", "filter: efk"), r"campaign\.yaml:6:\d+: .*efk"),
        (("name: rate\n", "neme: rate\n"), r"campaign\.yaml:9:\d+: vary\.1\.neme: unknown key 'neme'"),
        (("values: [1, 10]", "values: []"), r"expected at least 1 of them"),
        (("seeds: [3, 5]", "seeds: [3, 3]"), "duplicate seed"),
        (("seeds: [3, 5]", "seeds: 0"), "seeds"),
        (("{setting: identification.prior.factor,", "{"), "need the key of a `setting`"),
        (("ekf.transition: first_order", "gate: x"), r"campaign\.yaml:6:\d+: identification\.gate"),
        (
            ("{identification.ekf.transition", "{sensors.dvl.rate: 3 Hz, identification.ekf.transition"),
            "all filters share",
        ),
        (("values: [1, 10]", "values: [1, 10], known: false"), "`known: false` is only possible for"),
        (("setting: identification.prior.factor", "setting: seed"), "set `seeds` and `filters`"),
        (("name: rate", "name: identification.prior.factor"), "duplicate name"),
        (
            ("settings: {manoeuvre.duration: 5 s}", "settings: {manoeuvre.duration: 5 s, seed: 3}"),
            r"campaign\.yaml:2:1: settings: `seed` has no effect in a campaign",
        ),
        (("settings: {", "settings: {name: x, "), r"campaign\.yaml:2:1: settings: `name` has no effect"),
        (("ekf.transition: first_order", "filters: [ukf]"), r"campaign\.yaml:6:.*not possible here"),
        (
            ("seeds: [3, 5]", "seeds: 1000000000000000000"),
            r"campaign\.yaml:1:1: 8,0.* are too many.*at most 1,000,000",
        ),
        (("values: [1, 10]", f"values: {[*range(1, 6000)]}"), r"11,998 combinations of settings, .* are too many"),
        (("name: rate", "name: status"), "results have a column .status. already"),
        (("settings: {manoeuvre", "settings: {manouvre"), r"campaign\.yaml:2:\d+: manouvre"),
        (
            ("settings:", "experiment: nowhere\nsettings:"),
            r"campaign\.yaml:2:13: experiment: 'nowhere' is neither a file nor an experiment",
        ),
    ],
)
def test_mistakes_have_their_position(planned, change, complaint):
    old, new = change
    assert GRID.count(old) >= 1
    with pytest.raises(ConfigError, match=complaint):
        planned(GRID.replace(old, new, 1))


def test_relative_axis_needs_a_number(planned):
    text = "name: x\nfilters: [ckf]\nvary: [{setting: identification.gate, values: [2], relative: true}]\n"
    with pytest.raises(ConfigError, match=r"campaign\.yaml:3:\d+: identification\.gate: .*has no number there"):
        planned(text)
    text = "name: x\nfilters: [ckf]\nvary: [{setting: sensors.dvl.rate, values: [2 Hz], relative: true}]\n"
    with pytest.raises(ConfigError, match=r"multiplies by numbers, got '2 Hz'"):
        planned(text)


def test_default_filters_are_those_of_the_experiment(planned):
    plan = planned("name: x\nseeds: 1\n")
    assert [variant.name for variant in plan.filters] == ["ekf", "ckf", "tukf"]


@pytest.mark.parametrize(
    "text",
    [
        "filters: [ckf, {name: same, filter: ckf}]",
        "filters: [ckf]\nvary: [{setting: identification.prior.factor, values: [3, 3.0]}]",
        "filters: [ckf, {name: same, filter: ckf, settings: {identification.prior.factor: 0.7}}]",
    ],
)
def test_equal_runs_are_refused(planned, text):
    with pytest.raises(ConfigError, match=r"campaign\.yaml: .* the same: ckf with "):
        planned(f"name: twins\nseeds: 2\n{text}\n")


def test_campaign_on_a_page_is_the_campaign(planned, tmp_path):
    text = """\
name: whole
settings: {manoeuvre.duration: 5 s}
seeds: [3, 5]
filters: [ckf, {name: exact, filter: ekf, settings: {identification.ekf.transition: exact}}]
vary:
  - {setting: identification.prior.factor, values: [1, 3]}
  - {setting: vehicle.parameters.m, draw: {normal: [1, 0.02]}, relative: true, known: false}
"""
    campaign = planned(text, "settings.manoeuvre.duration=7 s").campaign
    copy = tmp_path / "copy.yaml"
    copy.write_text(dump_campaign(campaign))
    assert load_campaign(copy)[0] == campaign


DRAWN = """\
name: drawn
settings: {manoeuvre.duration: 5 s}
seeds: 40
filters: [{name: fit, filter: smoother, fit: true}]
vary:
  - name: faults
    drawn_levels: [0, 2]
    known: false
    levels:
      current: {manoeuvre.current_north: 0.1 m/s}
      delay: {sensors.gyroscope.delay: 20 ms}
      heavy: {vehicle.parameters.m: 50 kg}
"""


def test_each_seed_draws_some_levels_of_which_filters_know_nothing(planned):
    plan = planned(DRAWN)
    assert (plan.n_runs, plan.fixed_columns, plan.drawn_columns) == (40, [], ["faults"])
    numbers = set()
    for group in plan.groups():
        (run,), simulated = group.runs, json.loads(group.simulated)
        drawn = set(str(run.labels["faults"]).split("; ")) - {"none"}
        numbers.add(len(drawn))
        assert run.is_fit
        (assumed,) = map(json.loads, group.assumed)
        assert simulated["manoeuvre"]["current_north"] == (0.1 if "current" in drawn else 0.0)
        assert simulated["sensors"]["gyroscope"].get("delay", 0.0) == (0.02 if "delay" in drawn else 0.0)
        assert assumed["sensors"]["gyroscope"].get("delay", 0.0) == 0.0
        assert assumed["vehicle"]["parameters"]["m"]["value"] == pytest.approx(47.556)
    assert numbers == {0, 1, 2}


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("[0, 2]", "[2, 1]", "fewest, most"),
        ("[0, 2]", "[0, 4]", "fewest, most"),
        ("filter: smoother", "filter: ckf", "needs `filter: smoother`"),
    ],
)
def test_invalid_draw_or_fit_is_refused(planned, before, after, said):
    with pytest.raises(ConfigError, match=said):
        planned(DRAWN.replace(before, after))
