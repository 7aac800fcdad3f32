"""Results of a campaign on disk: Parquet files that together are one table, and the runs that failed."""

import csv
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
from filelock import FileLock, Timeout

from auvid_cli.campaign.axes import Label
from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.perform import Performed
from auvid_cli.campaign.plan import Run
from auvid_cli.data.files import replacing, write_text
from auvid_cli.errors import FileError

_TYPES = {str: pa.string(), int: pa.int64(), float: pa.float64()}
# So many files that came one by one are made one.
_MOST_PARTS = 200
# In a file's metadata: which files went into it.
_MERGED = b"auvid.merged"


class Failure(NamedTuple):
    """A row of ``failures.csv``."""

    run: str
    filter: str
    seed: int
    settings: str
    reason: str


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep others from working on the same results; whoever is killed leaves no lock behind.

    Raises
    ------
    FileError
        If somebody else does, or the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / ".lock", timeout=0):
            yield
    except Timeout:
        raise FileError(f"{folder}: another campaign is at work here; wait for it, or give --output") from None
    except OSError as error:
        raise FileError(f"{folder}: cannot be written: {error.strerror or error}") from None


class Store:
    """Results that are added to, whole groups of runs at a time; killed at any moment it holds what was added.

    Parameters
    ----------
    folder : pathlib.Path
        Made if it is missing.
    columns : mapping
        Of the axes, in their order: whether what they hold is numbers.

    Raises
    ------
    FileError
        If something there cannot be read or written.
    """

    def __init__(self, folder: Path, columns: Mapping[str, bool]) -> None:
        self.folder = folder / "results"
        self._failures_file = folder / "failures.csv"
        self._schema = pa.schema(
            [pa.field(name, _type_of(Measure.__annotations__[name])) for name in Measure._fields[:3]]
            + [pa.field(name, pa.float64() if numeric else pa.string()) for name, numeric in columns.items()]
            + [pa.field(name, _type_of(Measure.__annotations__[name])) for name in Measure._fields[3:]]
        )
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{self.folder}: cannot be made: {error.strerror or error}") from None
        merged = [_metadata(path).get(_MERGED, b"[]") for path in self._files()]
        # What was merged just before a campaign was killed still stands beside the whole.
        for name in (name for names in merged for name in json.loads(names)):
            (self.folder / name).unlink(missing_ok=True)
        self._parts = len(list(self.folder.glob("part-*.parquet")))
        self._failures = {failure.run: failure for failure in self._read_failures()}

    @property
    def failures(self) -> list[Failure]:
        """Runs that failed when they were last tried."""
        return list(self._failures.values())

    def finished(self) -> set[str]:
        """Identities of the runs that are there."""
        files = self._files()
        if not files:
            return set()
        rows = ds.dataset(files).to_table(columns=["run"], filter=ds.field("kind") == "run")
        return set(rows["run"].to_pylist())

    def conform(self, labels: Mapping[str, Mapping[str, Label]]) -> None:
        """Give what was stored with other axes the present ones.

        Parameters
        ----------
        labels : mapping
            Of each run of the campaign, by identity. Rows of other runs keep what they have.
        """
        for path in self._files():
            if not pq.read_schema(path).remove_metadata().equals(self._schema):
                rows = _read(path).to_pylist()
                table = self._table(row | dict(labels.get(row["run"], {})) for row in rows)
                # It keeps to itself what was merged into it.
                _write(table.replace_schema_metadata(_metadata(path)), path)

    def add(self, performed: Sequence[Performed]) -> None:
        """Keep what a group of runs came to."""
        rows = [row._asdict() | dict(done.run.labels) for done in performed for row in done.rows]
        if rows:
            _write(self._table(rows), self.folder / f"part-{uuid4().hex}.parquet")
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
        """Make one file of those that came one by one."""
        parts = sorted(self.folder.glob("part-*.parquet"))
        self._parts = 0
        if len(parts) < 2:
            return
        table = pa.concat_tables([_read(path) for path in parts])
        names = json.dumps([path.name for path in parts])
        # Never a name that was there before: what is merged is told from what comes later by its name alone.
        path = self.folder / f"block-{uuid4().hex}.parquet"
        _write(table.replace_schema_metadata({_MERGED: names.encode()}), path)
        for path in parts:
            path.unlink()

    def forget(self, runs: Collection[str]) -> None:
        """Take out runs that are to be done again."""
        wanted = pa.array(sorted(runs), pa.string())
        for path in self._files():
            table = _read(path)
            kept = table.filter(~ds.field("run").isin(wanted))
            if kept.num_rows == 0:
                path.unlink()
            elif kept.num_rows < table.num_rows:
                _write(kept, path)

    def rows(self, runs: Collection[str]) -> pa.Table:
        """All rows of some runs."""
        files = self._files()
        if not files:
            return self._schema.empty_table()
        wanted = pa.array(sorted(runs), pa.string())
        return ds.dataset(files, schema=self._schema).to_table(filter=ds.field("run").isin(wanted))

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob("[!.]*.parquet"))

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
        rows = csv.DictReader(StringIO(self._failures_file.read_text(encoding="utf-8")))
        try:
            return [
                Failure(row["run"], row["filter"], int(row["seed"]), row["settings"], row["reason"]) for row in rows
            ]
        except (TypeError, ValueError, KeyError):
            raise FileError(f"{self._failures_file}: is no list of failed runs; take it away") from None

    def _write_failures(self) -> None:
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(Failure._fields)
        writer.writerows(self._failures.values())
        write_text(self._failures_file, text.getvalue())


def _failure(run: Run, reason: str) -> Failure:
    return Failure(run.identity, run.filter, run.seed, run.settings(), " ".join(reason.split()))


def _type_of(annotation: Any) -> pa.DataType:
    return next(kind for python, kind in _TYPES.items() if annotation in (python, python | None))


def _metadata(path: Path) -> Mapping[bytes, bytes]:
    try:
        return pq.read_schema(path).metadata or {}
    except (pa.ArrowInvalid, OSError) as error:
        raise FileError(f"{path}: is no Parquet file, or damaged; take it away: {error}") from None


def _read(path: Path) -> pa.Table:
    try:
        return pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise FileError(f"{path}: is no Parquet file, or damaged; take it away: {error}") from None


def _write(table: pa.Table, path: Path) -> None:
    with replacing(path) as temporary:
        pq.write_table(table, temporary, compression="zstd")
