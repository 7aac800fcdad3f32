"""Results of a campaign on disk: Parquet files that form one table, and a list of failed runs."""

import csv
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from auvid_cli.campaign.cluster import RunResult
from auvid_cli.campaign.measures import Measure
from auvid_cli.config.campaign import Label
from auvid_cli.data.checks import csv_text, csv_value
from auvid_cli.data.files import damage_as_file_error, replacing, write_text
from auvid_cli.errors import FileError
from auvid_cli.regular_files import check_regular_file

_TYPES = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
# Number of files of single groups at which they are merged into one.
MAX_PARTS = 50
# Key in the metadata of a file for the names of the files merged into it.
_MERGED = b"auvid.merged"


class Failure(NamedTuple):
    """A row of ``failures.csv``."""

    run: str
    filter: str
    seed: int
    settings: str
    reason: str


class Store:
    """Results of groups of runs on disk, which are kept if the process is killed.

    Each group is first a file in ``incoming``. From time to time these are merged into ``results``, where readers
    see each run once, even after the process was killed. Runs that are not in the current plan are in ``earlier``, so
    that all runs in ``results`` can be compared.

    Parameters
    ----------
    columns : mapping
        Columns of the axes in order, and whether their values are numbers.

    Raises
    ------
    FileError
        If a file cannot be read or written.
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
        # If the process was killed, a run may be both in the results and in this list.
        self._failures = {failure.run: failure for failure in self._read_failures() if failure.run not in finished}

    @property
    def failures(self) -> list[Failure]:
        """Return the runs that failed in their last attempt."""
        return list(self._failures.values())

    def finished(self) -> set[str]:
        """Return the identities of all finished runs, also of earlier plans."""
        return _runs(self._results) | _runs(self._incoming) | _runs(self._earlier)

    def match_plan(self, labels: Mapping[str, Mapping[str, Label]]) -> None:
        """Move the runs of the current plan into the results, with their current labels, and move all others out.

        Parameters
        ----------
        labels : mapping
            Filter and axes of each run of the plan, by identity.
        """
        self._remove_merged()
        self.merge()
        planned = ds.field("run").isin(pa.array(list(labels), pa.string()))
        present = _runs(self._results)
        for path in _files(self._earlier):
            table = _read(path)
            # If the process was killed here before, a run may be in both folders.
            if back := [run for run in _unique(table) if run in labels and run not in present]:
                returning = ds.field("run").isin(pa.array(back, pa.string()))
                _write(self._relabelled(table.filter(returning), labels), _new(self._results))
            present.update(back)
            _keep(path, table, table.filter(~planned))
        for path in _files(self._results):
            table = _read(path)
            removed = table.filter(~planned)
            if removed.num_rows:
                _write(removed, _new(self._earlier))
            kept = table.filter(planned)
            if _keep(path, table, kept) and self._has_other_labels(kept, labels):
                _write(self._relabelled(kept, labels), path)
        if finished := present & self._failures.keys():
            for run in finished:
                del self._failures[run]
            self._write_failures()

    def set_aside(self) -> None:
        """Move all results to ``earlier``; `match_plan` returns those that are not repeated."""
        self._remove_merged()
        self.merge()
        for path in _files(self._results):
            _write(_read(path), _new(self._earlier))
            path.unlink()

    def add(self, performed: Sequence[RunResult]) -> None:
        """Add the results of a group of runs."""
        rows = [row._asdict() | dict(done.run.labels) for done in performed for row in done.rows]
        if rows:
            _write(self._table(rows), _new(self._incoming))
            self._parts += 1
        before = dict(self._failures)
        for done in performed:
            if done.failure:
                run, reason = done.run, " ".join(done.failure.split())
                self._failures[run.identity] = Failure(run.identity, run.filter, run.seed, run.settings(), reason)
            else:
                self._failures.pop(done.run.identity, None)
        if self._failures != before:
            self._write_failures()
        if self._parts >= MAX_PARTS:
            self.merge()

    def merge(self) -> None:
        """Merge the incoming files into one file of the results."""
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
        """Return all rows of the campaign, with one for each failed run; see `match_plan` for `labels`."""
        done = [self._conformed(_read(path)) for path in _files(self._results)]
        failures = [failure for failure in self.failures if failure.run in labels]
        failed = self._table(_failure_row(failure)._asdict() | dict(labels[failure.run]) for failure in failures)
        return pa.concat_tables([*done, failed])

    def _remove_merged(self) -> None:
        """Remove incoming files that a killed process had merged but not removed."""
        for path in _files(self._results):
            for name in _merged_into(path):
                (self._incoming / name).unlink(missing_ok=True)

    def _conformed(self, table: pa.Table) -> pa.Table:
        """Return rows with the current columns; null for axes that are new or have another type."""
        columns = [
            table[field.name]
            if field.name in table.schema.names and table.schema.field(field.name).type == field.type
            else pa.nulls(table.num_rows, field.type)
            for field in self._schema
        ]
        return pa.table(columns, schema=self._schema)

    def _has_other_labels(self, table: pa.Table, labels: Mapping[str, Mapping[str, Label]]) -> bool:
        if not table.schema.remove_metadata().equals(self._schema):
            return True
        names = [name for name in self._schema.names if name in next(iter(labels.values()))]
        runs = table.select(["run", *names]).group_by(["run", *names]).aggregate([]).to_pylist()
        current = self._table(labels[run["run"]] for run in runs).select(names).to_pylist()
        return [{name: run[name] for name in names} for run in runs] != current

    def _relabelled(self, table: pa.Table, labels: Mapping[str, Mapping[str, Label]]) -> pa.Table:
        # Keep the metadata: they contain the names of the merged files.
        relabelled = self._table(row | dict(labels[row["run"]]) for row in table.to_pylist())
        return relabelled.replace_schema_metadata(table.schema.metadata)

    def _table(self, rows: Iterable[Mapping[str, Any]]) -> pa.Table:
        columns = {field.name: [] for field in self._schema}
        for row in rows:
            for field in self._schema:
                value = row.get(field.name)
                is_text = field.type == pa.string() and value is not None
                columns[field.name].append(str(value) if is_text else value)
        return pa.table(columns, schema=self._schema)

    def _read_failures(self) -> list[Failure]:
        if not os.path.lexists(self._failures_file):
            return []
        try:
            check_regular_file(self._failures_file)
        except ValueError as error:
            raise FileError(f"{self._failures_file}: {error}") from None
        refusal = FileError(f"{self._failures_file}: not a list of failed runs; move it away to repeat these runs")
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
    """Return the row of a failed run."""
    status = f"failed: {failure.reason}"
    return Measure(failure.run, failure.filter, failure.seed, "run", "", "", status, "failed", failure.reason)


def _type_of(annotation: Any) -> pa.DataType:
    return next(kind for python, kind in _TYPES.items() if annotation in (python, python | None))


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("[!.]*.parquet"))


def _new(folder: Path) -> Path:
    """Return a path with a unique name; merged files are recognised by their names."""
    return folder / f"{uuid4().hex}.parquet"


def _runs(folder: Path) -> set[str]:
    return {run for path in _files(folder) for run in _unique(_read(path, ["run"]))}


def _unique(table: pa.Table) -> list[str]:
    return table["run"].unique().to_pylist()


def _keep(path: Path, table: pa.Table, kept: pa.Table) -> bool:
    """Keep only some rows of a file, remove it if there are none, and return whether it remains."""
    if kept.num_rows == 0:
        path.unlink()
    elif kept.num_rows < table.num_rows:
        _write(kept, path)
    return kept.num_rows > 0


def _merged_into(path: Path) -> list[str]:
    with _damage_as_error(path):
        check_regular_file(path)
        names = json.loads((pq.read_schema(path).metadata or {}).get(_MERGED, b"[]"))
        # Whatever the file contains, only files of one folder are removed.
        return [Path(name).name for name in names]


def _read(path: Path, columns: list[str] | None = None) -> pa.Table:
    with _damage_as_error(path):
        check_regular_file(path)
        # A ParquetFile does not turn names of folders into columns.
        table = pq.ParquetFile(path, page_checksum_verification=True).read(columns)
    for name in ("run",) if columns else Measure._fields[:3]:
        kind = _type_of(Measure.__annotations__[name])
        if name not in table.schema.names or table.schema.field(name).type != kind:
            raise FileError(f"{path}: not a file of this campaign; column {name!r} of {kind} is missing; move it away")
    return table


def _damage_as_error(path: Path) -> AbstractContextManager[None]:
    advice = "move it away to repeat its runs"
    return damage_as_file_error(lambda reason: f"{path}: not a Parquet file, or damaged; {advice}: {reason}")


def _write(table: pa.Table, path: Path) -> None:
    with replacing(path) as temporary:
        pq.write_table(table, temporary, compression="zstd", write_page_checksum=True)
