"""Results on disk: nothing twice, nothing lost, one table for whoever reads it."""

import json

import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.perform import Performed
from auvid_cli.campaign.plan import Run
from auvid_cli.campaign.store import Store, locked
from auvid_cli.errors import FileError

COLUMNS = {"factor": True, "rate": False}


def finished(name, factor=1.0, rate="slow", error=2.5):
    run = Run(name, {"factor": factor, "rate": rate}, "ckf", 1)
    whole = Measure(name, "ckf", 1, "run", "", "", "completed", steady_state_error_percent=error, components=22)
    part = Measure(name, "ckf", 1, "coefficient", "X_u|u|", "kg/m", "completed", true=-3.0, estimate=-3.1)
    return Performed(run, [whole, part], "", None)


def failed(name, reason="no data"):
    return Performed(Run(name, {"factor": 1.0, "rate": "slow"}, "ckf", 1), [], reason, None)


def test_what_is_added_is_there_for_the_next_one(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b", 3.0, "fast")])
    store.add([finished("c")])
    again = Store(tmp_path, COLUMNS)
    assert again.finished() == {"a", "b", "c"}
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


def test_many_files_become_one_with_the_same_rows(tmp_path):
    store = Store(tmp_path, COLUMNS)
    for k in range(7):
        store.add([finished(f"run-{k}", factor=float(k))])
    before = pd.read_parquet(tmp_path / "results").sort_values(["run", "kind"], ignore_index=True)
    store.merge()
    assert len(list((tmp_path / "results").iterdir())) == 1
    after = pd.read_parquet(tmp_path / "results").sort_values(["run", "kind"], ignore_index=True)
    pd.testing.assert_frame_equal(before, after)


def test_files_are_merged_by_themselves_when_there_are_many(tmp_path, monkeypatch):
    monkeypatch.setattr("auvid_cli.campaign.store._MOST_PARTS", 4)
    store = Store(tmp_path, COLUMNS)
    for k in range(10):
        store.add([finished(f"run-{k}")])
    assert len(list((tmp_path / "results").iterdir())) == 4
    assert len(Store(tmp_path, COLUMNS).finished()) == 10


def test_killed_between_merging_and_taking_away_nothing_is_there_twice(tmp_path):
    store = Store(tmp_path, COLUMNS)
    for k in range(3):
        store.add([finished(f"run-{k}")])
    parts = {path.name: path.read_bytes() for path in (tmp_path / "results").iterdir()}
    store.merge()
    for name, content in parts.items():
        (tmp_path / "results" / name).write_bytes(content)
    assert len(pd.read_parquet(tmp_path / "results")) == 12
    assert Store(tmp_path, COLUMNS).finished() == {"run-0", "run-1", "run-2"}
    assert len(pd.read_parquet(tmp_path / "results")) == 6


def test_killed_while_writing_leaves_nothing_that_counts(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a")])
    (tmp_path / "results" / ".part-b-x1.parquet").write_bytes(b"PAR1 half of it")
    assert Store(tmp_path, COLUMNS).finished() == {"a"}
    assert set(pd.read_parquet(tmp_path / "results")["run"]) == {"a"}


def test_a_run_that_failed_is_told_until_it_succeeds(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([failed("a", "the vehicle\ncapsized, twice"), finished("b")])
    (failure,) = Store(tmp_path, COLUMNS).failures
    assert failure == ("a", "ckf", 1, "factor = 1.0, rate = slow", "the vehicle capsized, twice")
    assert Store(tmp_path, COLUMNS).finished() == {"b"}
    again = Store(tmp_path, COLUMNS)
    again.add([finished("a")])
    assert Store(tmp_path, COLUMNS).failures == []
    assert Store(tmp_path, COLUMNS).finished() == {"a", "b"}


def test_what_is_done_again_after_a_merge_stays(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a")])
    store.add([finished("b")])
    store.merge()
    store.forget(["a"])
    store.add([finished("a", error=1.5)])
    store.add([finished("c")])
    assert Store(tmp_path, COLUMNS).finished() == {"a", "b", "c"}
    store.merge()
    assert Store(tmp_path, COLUMNS).finished() == {"a", "b", "c"}
    table = pd.read_parquet(tmp_path / "results")
    assert list(table.loc[(table["run"] == "a") & (table["kind"] == "run"), "steady_state_error_percent"]) == [1.5]


def test_two_campaigns_do_not_share_a_folder(tmp_path):
    with locked(tmp_path), pytest.raises(FileError, match="another campaign is at work here"), locked(tmp_path):
        pass
    with locked(tmp_path):
        pass


def test_what_is_to_be_done_again_is_forgotten(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a"), finished("b")])
    store.add([finished("c")])
    store.forget(["a", "c"])
    assert Store(tmp_path, COLUMNS).finished() == {"b"}


def test_results_take_on_the_axes_that_a_campaign_has_now(tmp_path):
    store = Store(tmp_path, {"factor": True})
    run = Run("a", {"factor": 1.0}, "ckf", 1)
    store.add([finished("a")._replace(run=run), finished("other")._replace(run=run._replace(identity="other"))])
    wider = Store(tmp_path, {"factor": True, "rate": False})
    wider.conform({"a": {"factor": 1.0, "rate": "fast"}})
    table = pd.read_parquet(tmp_path / "results")
    assert set(table.loc[table["run"] == "a", "rate"]) == {"fast"}
    assert table.loc[table["run"] == "other", "rate"].isna().all()
    assert set(wider.rows(["a"])["rate"].to_pylist()) == {"fast"}


def test_numbers_become_text_where_an_axis_has_both(tmp_path):
    Store(tmp_path, {"factor": True, "rate": False}).add([finished("a", factor=3.0)])
    mixed = Store(tmp_path, {"factor": False, "rate": False})
    mixed.conform({"a": {"factor": 3.0, "rate": "slow"}})
    mixed.add([finished("b", factor="wide")])
    assert set(mixed.rows(["a", "b"])["factor"].to_pylist()) == {"3.0", "wide"}


@pytest.mark.parametrize("place", ["results/part-*.parquet", "failures.csv"])
def test_a_damaged_file_is_named(tmp_path, place):
    Store(tmp_path, COLUMNS).add([finished("a"), failed("b")])
    (path,) = tmp_path.glob(place)
    path.write_bytes(b"run,nonsense\n1,2\n")
    with pytest.raises(FileError, match=f"{path.name}.*take it away"):
        Store(tmp_path, COLUMNS)


@given(
    operations=st.lists(
        st.one_of(
            st.tuples(st.just("add"), st.lists(st.integers(0, 20), min_size=1, max_size=4, unique=True)),
            st.tuples(st.just("merge"), st.none()),
            st.tuples(st.just("forget"), st.lists(st.integers(0, 20), max_size=4)),
            st.tuples(st.just("open"), st.none()),
        ),
        max_size=12,
    )
)
def test_whatever_is_done_each_run_is_there_once(tmp_path_factory, operations):
    folder = tmp_path_factory.mktemp("store")
    store, wanted = Store(folder, COLUMNS), set()
    for what, runs in operations:
        if what == "add":
            new = [f"{k}" for k in runs if f"{k}" not in wanted]
            store.add([finished(name) for name in new])
            wanted |= set(new)
        elif what == "merge":
            store.merge()
        elif what == "forget":
            store.forget([f"{k}" for k in runs])
            wanted -= {f"{k}" for k in runs}
        else:
            store = Store(folder, COLUMNS)
    assert store.finished() == wanted
    rows = [row for path in (folder / "results").glob("*.parquet") for row in pq.read_table(path)["run"].to_pylist()]
    assert sorted(rows) == sorted(2 * list(wanted))


def test_metadata_of_a_merged_file_names_what_went_into_it(tmp_path):
    store = Store(tmp_path, COLUMNS)
    store.add([finished("a")])
    store.add([finished("b")])
    parts = sorted(path.name for path in (tmp_path / "results").iterdir())
    store.merge()
    (path,) = (tmp_path / "results").iterdir()
    assert sorted(json.loads(pq.read_schema(path).metadata[b"auvid.merged"])) == parts
