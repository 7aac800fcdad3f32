"""Results on disk: no run is lost or duplicated, and all form one table."""

import json

import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.campaign.cluster import RunResult
from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.plan import CampaignRun
from auvid_cli.campaign.store import MAX_PARTS, Store, _read
from auvid_cli.data.files import locked
from auvid_cli.errors import FileError

COLUMNS = {"factor": True, "rate": False}


def finished(name, factor=1.0, rate="slow", error=2.5):
    run = CampaignRun(name, {"factor": factor, "rate": rate}, "ckf", 1)
    whole = Measure(
        name, "ckf", 1, "run", "", "", "completed", "sound", "", steady_state_error_percent=error, components=22
    )
    part = Measure(name, "ckf", 1, "coefficient", "X_u|u|", "kg/m", "completed", "sound", "", true=-3.0, estimate=-3.1)
    return RunResult(run, [whole, part], "", None)


def failed(name, reason="no data"):
    return RunResult(CampaignRun(name, {"factor": 1.0, "rate": "slow"}, "ckf", 1), [], reason, None)


def labels_of(*names):
    return {name: {"filter": "ckf", "factor": 1.0, "rate": "slow"} for name in names}


def test_added_runs_are_found_by_the_next_store(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b", 3.0, "fast")])
    store.add([finished("c")])
    again = Store(tmp_path, COLUMNS)
    assert again.finished() == {"a", "b", "c"}
    again.merge()
    table = pd.read_parquet(tmp_path / "results")
    assert len(table) == 6
    row = table[(table["run"] == "b") & (table["kind"] == "coefficient")].iloc[0]
    assert (row["factor"], row["rate"], row["name"], row["true"], row["estimate"]) == (
        3.0,
        "fast",
        "X_u|u|",
        -3.0,
        -3.1,
    )
    assert pd.isna(row["rmse"])


def test_merge_keeps_all_rows(tmp_path):
    store = Store(tmp_path, COLUMNS)
    for k in range(7):
        store.add([finished(f"run-{k}", factor=float(k))])
    before = pd.read_parquet(tmp_path / "incoming").sort_values(["run", "kind"], ignore_index=True)
    store.merge()
    assert not list((tmp_path / "incoming").iterdir())
    assert len(list((tmp_path / "results").iterdir())) == 1
    after = pd.read_parquet(tmp_path / "results").sort_values(["run", "kind"], ignore_index=True)
    pd.testing.assert_frame_equal(before, after)


@pytest.mark.slow
def test_many_incoming_files_are_merged(tmp_path):
    store, n_runs = Store(tmp_path, COLUMNS), 2 * MAX_PARTS + 2
    for k in range(n_runs):
        store.add([finished(f"run-{k}")])
    assert len(list((tmp_path / "results").iterdir())) == 2
    assert len(list((tmp_path / "incoming").iterdir())) == 2
    assert len(Store(tmp_path, COLUMNS).finished()) == n_runs


def test_kill_between_merging_and_removing_duplicates_no_run(tmp_path):
    store = Store(tmp_path, COLUMNS)
    for k in range(3):
        store.add([finished(f"run-{k}")])
    parts = {path.name: path.read_bytes() for path in (tmp_path / "incoming").iterdir()}
    store.merge()
    for name, content in parts.items():
        (tmp_path / "incoming" / name).write_bytes(content)
    # Readers see each run once, also before the next store.
    assert len(pd.read_parquet(tmp_path / "results")) == 6
    again = Store(tmp_path, COLUMNS)
    assert again.finished() == {"run-0", "run-1", "run-2"}
    again.match_plan(labels_of("run-0", "run-1", "run-2"))
    assert len(pd.read_parquet(tmp_path / "results")) == 6
    assert not list((tmp_path / "incoming").iterdir())


def test_kill_while_writing_adds_no_rows(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a")])
    (tmp_path / "incoming" / ".b-x1.parquet").write_bytes(b"PAR1 half of it")
    again = Store(tmp_path, COLUMNS)
    assert again.finished() == {"a"}
    again.merge()
    assert set(pd.read_parquet(tmp_path / "results")["run"]) == {"a"}


def test_repeated_run_is_no_longer_a_failure(tmp_path):
    """Killed between the result and the list of failures."""
    store = Store(tmp_path, COLUMNS)
    store.add([failed("a")])
    before = (tmp_path / "failures.csv").read_bytes()
    store.add([finished("a")])
    (tmp_path / "failures.csv").write_bytes(before)
    assert Store(tmp_path, COLUMNS).failures == []


def test_failure_is_listed_until_the_run_succeeds(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([failed("a", "the vehicle\ncapsized, twice"), finished("b")])
    (failure,) = Store(tmp_path, COLUMNS).failures
    assert failure == ("a", "ckf", 1, "factor = 1.0, rate = slow", "the vehicle capsized, twice")
    assert Store(tmp_path, COLUMNS).finished() == {"b"}
    again = Store(tmp_path, COLUMNS)
    again.add([finished("a")])
    assert Store(tmp_path, COLUMNS).failures == []
    assert Store(tmp_path, COLUMNS).finished() == {"a", "b"}


def test_repeated_runs_replace_earlier_ones(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b")])
    store.set_aside()
    assert not list((tmp_path / "results").iterdir())
    store.add([finished("a", error=1.5)])
    # After an interrupt here, runs that were not repeated come back, and repeated ones stay.
    again = Store(tmp_path, COLUMNS)
    again.match_plan(labels_of("a", "b"))
    table = pd.read_parquet(tmp_path / "results")
    errors = table[table["kind"] == "run"].set_index("run")["steady_state_error_percent"]
    assert errors.to_dict() == {"a": 1.5, "b": 2.5}
    assert not list((tmp_path / "earlier").iterdir())


def test_repeated_run_that_fails_keeps_earlier_result(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b")])
    store.set_aside()
    store.add([failed("a"), failed("c"), finished("b", error=1.5)])
    store.match_plan(labels_of("a", "b", "c"))
    table = store.rows(labels_of("a", "b", "c")).to_pandas()
    own = table[table["kind"] == "run"].set_index("run")
    assert own["steady_state_error_percent"].dropna().to_dict() == {"a": 2.5, "b": 1.5}
    assert own["status"].to_dict() == {"a": "completed", "b": "completed", "c": "failed: no data"}
    assert [failure.run for failure in store.failures] == ["c"]
    assert Store(tmp_path, COLUMNS).failures == store.failures


def test_failed_run_has_the_labels_of_the_plan(tmp_path):
    """An axis with a value other than a number is text."""
    store = Store(tmp_path, {"gate": False})
    labels = {name: {"filter": "ckf", "gate": 4} for name in "ab"}
    runs = [CampaignRun(name, {"gate": 4}, "ckf", 1) for name in "ab"]
    store.add([finished("a")._replace(run=runs[0]), failed("b")._replace(run=runs[1])])
    store.merge()
    rows = store.rows(labels)
    assert set(rows["run"].to_pylist()) == {"a", "b"}
    assert set(rows["gate"].to_pylist()) == {"4"}


def test_error_within_the_lock_is_not_a_lock_error(tmp_path):
    with pytest.raises(BrokenPipeError), locked(tmp_path):
        raise BrokenPipeError
    with locked(tmp_path):
        pass


def test_results_get_the_current_axes(tmp_path):
    store = Store(tmp_path, {"factor": True})
    store.add([finished("a")._replace(run=CampaignRun("a", {"factor": 1.0}, "ckf", 1))])
    wider = Store(tmp_path, COLUMNS)
    wider.match_plan({"a": {"filter": "ckf", "factor": 1.0, "rate": "fast"}})
    table = pd.read_parquet(tmp_path / "results")
    assert set(table["rate"]) == {"fast"}
    assert wider.rows({})["rate"].to_pylist() == ["fast", "fast"]


def test_axis_of_numbers_and_text_is_text(tmp_path):
    Store(tmp_path, COLUMNS).add([finished("a", factor=3.0)])
    mixed = Store(tmp_path, {"factor": False, "rate": False})
    mixed.match_plan({"a": {"filter": "ckf", "factor": 3.0, "rate": "slow"}})
    mixed.add([finished("b", factor="wide")])
    mixed.merge()
    assert set(mixed.rows({})["factor"].to_pylist()) == {"3.0", "wide"}


def test_runs_of_other_settings_are_set_aside_and_return(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b")])
    store.add([finished("c")])
    other = Store(tmp_path, {"factor": True})
    other.match_plan({name: {"filter": "ckf", "factor": 2.0} for name in ("b", "new")})
    table = pd.read_parquet(tmp_path / "results")
    assert set(table["run"]) == {"b"}
    assert "rate" not in table
    # Nothing of it has to be done again.
    assert other.finished() == {"a", "b", "c"}
    again = Store(tmp_path, COLUMNS)
    again.match_plan(labels_of(*"abc"))
    table = pd.read_parquet(tmp_path / "results")
    assert sorted(table["run"]) == ["a", "a", "b", "b", "c", "c"]
    assert set(table["rate"]) == {"slow"}
    assert not list((tmp_path / "earlier").glob("*.parquet"))


def test_kill_while_runs_return_duplicates_no_run(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a")])
    store.merge()
    (part,) = (tmp_path / "results").iterdir()
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "part-1.parquet").write_bytes(part.read_bytes())
    (tmp_path / "earlier" / "part-2.parquet").write_bytes(part.read_bytes())
    Store(tmp_path, COLUMNS).match_plan(labels_of("a"))
    assert len(pd.read_parquet(tmp_path / "results")) == 2
    assert not list((tmp_path / "earlier").glob("*.parquet"))


def test_results_get_the_current_labels(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a", rate="low"), finished("b", rate="high")])
    store.merge()
    swapped = {
        "a": {"filter": "first", "factor": 1.0, "rate": "high"},
        "b": {"filter": "first", "factor": 1.0, "rate": "low"},
    }
    Store(tmp_path, COLUMNS).match_plan(swapped)
    table = pd.read_parquet(tmp_path / "results")
    assert table.groupby("run")["rate"].agg(set).to_dict() == {"a": {"high"}, "b": {"low"}}
    assert set(table["filter"]) == {"first"}


def test_axis_that_becomes_numeric_replaces_text(tmp_path):
    store = Store(tmp_path, {"prior": False})
    runs = {name: CampaignRun(name, {"prior": name}, "ckf", 1) for name in ("low", "high")}
    store.add([finished(name)._replace(run=run) for name, run in runs.items()])
    numeric = Store(tmp_path, {"prior": True})
    numeric.match_plan({"low": {"filter": "ckf", "prior": 0.3}})
    assert numeric.rows({})["prior"].to_pylist() == [0.3, 0.3]


def test_reading_creates_no_files(tmp_path):
    store = Store(tmp_path / "new", COLUMNS)
    assert store.finished() == set()
    assert store.rows({}).num_rows == 0
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("place", ["incoming/*.parquet", "failures.csv"])
def test_damaged_file_is_refused_with_its_name(tmp_path, place):
    Store(tmp_path, COLUMNS).add([finished("a"), failed("b")])
    (path,) = tmp_path.glob(place)
    path.write_bytes(b"run,nonsense\n1,2\n")
    with pytest.raises(FileError, match=f"{path.name}.*move it away"):
        Store(tmp_path, COLUMNS)


@pytest.mark.parametrize("place", ["results", "incoming", "earlier"])
def test_device_is_refused(tmp_path, place):
    """None of these can be read completely."""
    (tmp_path / place).mkdir()
    (tmp_path / place / "a.parquet").symlink_to("/dev/null")
    with pytest.raises(FileError, match=r"a\.parquet: .*pipe or a device"):
        Store(tmp_path, COLUMNS)


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe",
        b"",
        b"run,filter,seed,settings,reason\na,ckf,one,,\n",
        b"run,filter,seed,settings,reason\na,ckf,1\n",
        b"run,filter,seed,settings\na,ckf,1,x\n",
        b"run,filter,seed,settings,reason\na,ckf,1,x," + b"y" * 200_000 + b"\n",
    ],
    ids=["not UTF-8", "empty", "a seed that is none", "a short row", "a column less", "a long cell"],
)
def test_damaged_list_of_failures_is_refused_and_kept(tmp_path, content):
    (tmp_path / "failures.csv").write_bytes(content)
    with pytest.raises(FileError, match=r"failures\.csv: .*move it away"):
        Store(tmp_path, COLUMNS)
    assert (tmp_path / "failures.csv").read_bytes() == content


@pytest.mark.slow
def test_every_flipped_byte_is_detected(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b")])
    (path,) = (tmp_path / "incoming").glob("*.parquet")
    whole, table = path.read_bytes(), pq.read_table(path)
    pages = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    noticed = []
    for place in range(4, pages, 7):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        try:
            assert _read(path).equals(table), place
        except FileError:
            noticed.append(place)
    assert len(noticed) > pages // 14


def test_foreign_parquet_file_is_refused(tmp_path):
    (tmp_path / "results").mkdir()
    pd.DataFrame({"time": [1.0], "u": [2.0]}).to_parquet(tmp_path / "results/mission.parquet")
    with pytest.raises(FileError, match=r"mission\.parquet: .*'run'.*; move it away"):
        Store(tmp_path, COLUMNS)


def test_merged_names_remove_no_file_elsewhere(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a")])
    store.merge()
    (path,) = (tmp_path / "results").glob("*.parquet")
    (tmp_path / "precious").write_text("kept")
    names = json.dumps(["../precious"]).encode()
    pq.write_table(pq.read_table(path).replace_schema_metadata({b"auvid.merged": names}), path)
    Store(tmp_path, COLUMNS).set_aside()
    assert (tmp_path / "precious").is_file()


@pytest.mark.slow
@given(
    operations=st.lists(
        st.one_of(
            st.tuples(st.just("add"), st.lists(st.integers(0, 20), min_size=1, max_size=4, unique=True)),
            st.tuples(st.just("merge"), st.none()),
            st.tuples(st.just("aside"), st.none()),
            st.tuples(st.just("conform"), st.sets(st.integers(0, 20), min_size=1)),
        ),
        max_size=12,
    )
)
def test_any_operations_keep_each_run_once(tmp_path_factory, operations):
    folder = tmp_path_factory.mktemp("store")
    everything: set[str] = set()
    for what, runs in operations:
        store = Store(folder, COLUMNS)
        if what == "add":
            new = [f"{k}" for k in runs if f"{k}" not in everything]
            store.add([finished(name) for name in new])
            everything |= set(new)
        elif what == "merge":
            store.merge()
        elif what == "aside":
            store.set_aside()
        else:
            mine = {f"{k}" for k in runs}
            store.match_plan(labels_of(*mine))
            assert set(store.rows({})["run"].to_pylist()) == everything & mine
    assert Store(folder, COLUMNS).finished() == everything
    rows = [row for path in folder.glob("*/*.parquet") for row in pq.read_table(path)["run"].to_pylist()]
    assert sorted(rows) == sorted(2 * list(everything))
