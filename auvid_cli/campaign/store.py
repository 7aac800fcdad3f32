"""Results of a campaign on disk: Parquet files that together are one table, and the runs that failed."""

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from auvid_cli.campaign.axes import Label
from auvid_cli.campaign.cluster import RunResult
from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.plan import CampaignRun
from auvid_cli.data.checks import csv_text, csv_value
from auvid_cli.data.files import damage_as_file_error, replacing, write_text
from auvid_cli.errors import FileError
from auvid_cli.regular_files import check_regular_file

_TYPES = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
# So many files that came one by one are made one.
_MOST_PARTS = 50
# In a file's metadata: which files went into it.
_MERGED = b"auvid.merged"


class Failure(NamedTuple):
    """A row of ``failures.csv``."""

    run: str
    filter: str
    seed: int
    settings: str
    reason: str


class Store:
    """Results that are added to, whole groups of runs at a time; killed at any moment it holds what was added.

    Groups come in one file each, apart from the results that others read, and are merged into those now and then:
    whoever reads the results sees each run once, also after a kill. Runs that are none of the campaign, as its settings
    are now, are kept apart as well: what stands together can be compared.

    Parameters
    ----------
    folder : pathlib.Path
    columns : mapping
        Of the axes, in their order: whether what they hold is numbers.

    Raises
    ------
    FileError
        If something there cannot be read or written.
    """

    def __init__(self, folder: Path, columns: Mapping[str, bool]) -> None:
        self._results, self._incoming, self._earlier = (folder / name for name in ("results", "incoming", "earlier"))
        self._failures_file = folder / "failures.csv"
        self._schema = pa.schema(
            [pa.field(name, _type_of(Measure.__annotations__[name])) for name in Measure._fields[:3]]
            + [pa.field(name, pa.float64() if numeric else pa.string()) for name, numeric in columns.items()]
            + [pa.field(name, _type_of(Measure.__annotations__[name])) for name in Measure._fields[3:]]
        )
        self._parts = len(_files(self._incoming))
        finished = self.finished()
        # Killed between writing a result and this list, a run may stand in both.
        self._failures = {failure.run: failure for failure in self._read_failures() if failure.run not in finished}

    @property
    def failures(self) -> list[Failure]:
        """Return the runs that failed when they were last tried."""
        return list(self._failures.values())

    def finished(self) -> set[str]:
        """Return the identities of the runs that are there, those that are kept apart included."""
        return _runs(self._results) | _runs(self._incoming) | _runs(self._earlier)

    def match_plan(self, labels: Mapping[str, Mapping[str, Label]]) -> None:
        """Hold the runs of the campaign as it is now, named as they are now, and keep the others apart.

        Parameters
        ----------
        labels : mapping
            Of each run of the campaign, by identity: its filter and its axes.
        """
        self._forget_what_was_merged()
        self.merge()
        wanted = ds.field("run").isin(pa.array(list(labels), pa.string()))
        here = _runs(self._results)
        for path in _files(self._earlier):
            table = _read(path)
            # Whoever was killed here may have left runs on both sides.
            back = [run for run in _unique(table) if run in labels and run not in here]
            if back:
                returning = ds.field("run").isin(pa.array(back, pa.string()))
                _write(self._relabelled(table.filter(returning), labels), _new(self._results))
            here.update(back)
            _keep(path, table, table.filter(~wanted))
        for path in _files(self._results):
            table = _read(path)
            away = table.filter(~wanted)
            if away.num_rows:
                _write(away, _new(self._earlier))
            kept = table.filter(wanted)
            if _keep(path, table, kept) and self._is_named_otherwise(kept, labels):
                _write(self._relabelled(kept, labels), path)
        if standing := here & self._failures.keys():
            for run in standing:
                del self._failures[run]
            self._write_failures()

    def set_aside(self) -> None:
        """Put away all results: those that are not done again come back with the next `match_plan`."""
        self._forget_what_was_merged()
        self.merge()
        for path in _files(self._results):
            _write(_read(path), _new(self._earlier))
            path.unlink()

    def add(self, performed: Sequence[RunResult]) -> None:
        """Keep what a group of runs came to."""
        rows = [row._asdict() | dict(done.run.labels) for done in performed for row in done.rows]
        if rows:
            _write(self._table(rows), _new(self._incoming))
            self._parts += 1
        before = dict(self._failures)
        for done in performed:
            if done.failure:
                self._failures[done.run.identity] = _failure(done.run, done.failure)
            else:
                self._failures.pop(done.run.identity, None)
        if self._failures != before:
            self._write_failures()
        if self._parts >= _MOST_PARTS:
            self.merge()

    def merge(self) -> None:
        """Add to the results what came in."""
        parts = _files(self._incoming)
        self._parts = 0
        if not parts:
            return
        table = pa.concat_tables([self._conformed(_read(path)) for path in parts])
        names = json.dumps([path.name for path in parts])
        _write(table.replace_schema_metadata({_MERGED: names.encode()}), _new(self._results))
        for path in parts:
            path.unlink()

    def rows(self, labels: Mapping[str, Mapping[str, Label]]) -> pa.Table:
        """Read all rows of the campaign, one for each of its failed runs included; `labels` as of `match_plan`."""
        done = [self._conformed(_read(path)) for path in _files(self._results)]
        failures = [failure for failure in self.failures if failure.run in labels]
        failed = self._table(_failure_row(failure)._asdict() | dict(labels[failure.run]) for failure in failures)
        return pa.concat_tables([*done, failed])

    def _forget_what_was_merged(self) -> None:
        """Take away what a campaign that was killed had merged, but not yet taken away."""
        for path in _files(self._results):
            for name in _merged_into(path):
                (self._incoming / name).unlink(missing_ok=True)

    def _conformed(self, table: pa.Table) -> pa.Table:
        """Give rows the present columns; of axes that were not there, or held something else, nothing yet."""
        columns = [
            table[field.name]
            if field.name in table.schema.names and table.schema.field(field.name).type == field.type
            else pa.nulls(table.num_rows, field.type)
            for field in self._schema
        ]
        return pa.table(columns, schema=self._schema)

    def _is_named_otherwise(self, table: pa.Table, labels: Mapping[str, Mapping[str, Label]]) -> bool:
        if not table.schema.remove_metadata().equals(self._schema):
            return True
        names = [name for name in self._schema.names if name in next(iter(labels.values()))]
        runs = table.select(["run", *names]).group_by(["run", *names]).aggregate([]).to_pylist()
        wanted = self._table(labels[run["run"]] for run in runs).select(names).to_pylist()
        return [{name: run[name] for name in names} for run in runs] != wanted

    def _relabelled(self, table: pa.Table, labels: Mapping[str, Mapping[str, Label]]) -> pa.Table:
        # A file keeps to itself what was merged into it.
        named = self._table(row | dict(labels[row["run"]]) for row in table.to_pylist())
        return named.replace_schema_metadata(table.schema.metadata)

    def _table(self, rows: Iterable[Mapping[str, Any]]) -> pa.Table:
        columns = {field.name: [] for field in self._schema}
        for row in rows:
            for field in self._schema:
                value = row.get(field.name)
                is_text = field.type == pa.string() and value is not None
                columns[field.name].append(str(value) if is_text else value)
        return pa.table(columns, schema=self._schema)

    def _read_failures(self) -> list[Failure]:
        if not self._failures_file.is_file():
            return []
        refusal = FileError(f"{self._failures_file}: is no list of failed runs; move it away, and they are tried again")
        try:
            header, *rows = csv.reader(StringIO(self._failures_file.read_text(encoding="utf-8")))
            if tuple(header) != Failure._fields:
                raise refusal
            texts = ([csv_value(cell) for cell in row] for row in rows)
            return [Failure(run, name, int(seed), settings, reason) for run, name, seed, settings, reason in texts]
        except (ValueError, csv.Error):
            raise refusal from None

    def _write_failures(self) -> None:
        write_text(self._failures_file, csv_text(Failure._fields, self._failures.values()))


def _failure_row(failure: Failure) -> Measure:
    """Make the row by which a failed run stands among those that did not fail."""
    status = f"failed: {failure.reason}"
    return Measure(failure.run, failure.filter, failure.seed, "run", "", "", status, "failed", failure.reason)


def _failure(run: CampaignRun, reason: str) -> Failure:
    return Failure(run.identity, run.filter, run.seed, run.settings(), " ".join(reason.split()))


def _type_of(annotation: Any) -> pa.DataType:
    return next(kind for python, kind in _TYPES.items() if annotation in (python, python | None))


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("[!.]*.parquet"))


def _new(folder: Path) -> Path:
    """Return a name that was never there before: it alone tells what is merged from what comes later."""
    return folder / f"{uuid4().hex}.parquet"


def _runs(folder: Path) -> set[str]:
    return {run for path in _files(folder) for run in _unique(_read(path, ["run"]))}


def _unique(table: pa.Table) -> list[str]:
    return table["run"].unique().to_pylist()


def _keep(path: Path, table: pa.Table, kept: pa.Table) -> bool:
    """Make a file hold only some of its rows; return whether it is still there."""
    if kept.num_rows == 0:
        path.unlink()
    elif kept.num_rows < table.num_rows:
        _write(kept, path)
    return kept.num_rows > 0


def _merged_into(path: Path) -> list[str]:
    with _refusing_damage(path):
        check_regular_file(path)
        names = json.loads((pq.read_schema(path).metadata or {}).get(_MERGED, b"[]"))
        # Whatever wrote it, what is taken away lies in one folder.
        return [Path(name).name for name in names]


def _read(path: Path, columns: list[str] | None = None) -> pa.Table:
    with _refusing_damage(path):
        check_regular_file(path)
        # By itself, so that a folder's name is no column.
        table = pq.ParquetFile(path, page_checksum_verification=True).read(columns)
    for name in ("run",) if columns else Measure._fields[:3]:
        kind = _type_of(Measure.__annotations__[name])
        if name not in table.schema.names or table.schema.field(name).type != kind:
            raise FileError(f"{path}: is no file of this campaign: it has no column {name!r} of {kind}; move it away")
    return table


def _refusing_damage(path: Path) -> AbstractContextManager[None]:
    advice = "move it away, and the runs in it are done again"
    return damage_as_file_error(lambda reason: f"{path}: is no Parquet file, or damaged; {advice}: {reason}")


def _write(table: pa.Table, path: Path) -> None:
    with replacing(path) as temporary:
        pq.write_table(table, temporary, compression="zstd", write_page_checksum=True)
