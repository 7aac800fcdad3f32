"""Studies of many seeds that can be interrupted: rows of finished runs are kept in docs/rows."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path
from time import process_time

import pandas as pd

from auvid_cli.data.files import replacing

# Settings of the default experiment when these studies were made: a wide prior, and a gentle start of the spiral.
WIDE_PRIOR = "identification.prior.factor=3"
EARLIER_SPIRAL = "manoeuvre=manoeuvres/spiral_gentle.yaml", WIDE_PRIOR
# Column of the processor time of a run, s; the same in all rows of the run.
RUN_TIME = "run_time"
_FOLDER = Path(__file__).with_name("rows")


def asked_seeds(description: str | None, seeds: int) -> int:
    """Read the number of seeds from the command line of a study; `seeds` is its default."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=seeds, help=f"kept runs are not repeated; default: {seeds}")
    return parser.parse_args().seeds


def all_rows(name: str, runs: Iterable[tuple[str, int]], found: Callable[[str, int], pd.DataFrame]) -> pd.DataFrame:
    """Do the runs (case and seed) of a study that are not kept yet, keep their rows, and return the rows of the runs.

    Without runs, all kept rows are returned.
    """
    kept, runs = kept_rows(name), list(runs)
    done = set() if kept is None else {*kept[["case", "seed"]].itertuples(index=False, name=None)}
    for case, seed in runs:
        if (case, seed) not in done:
            begin = process_time()
            rows = found(case, seed).assign(case=case, seed=seed)
            rows[RUN_TIME] = round(process_time() - begin, 2)
            keep_rows(name, rows if kept is None else pd.concat([kept, rows]))
            kept = kept_rows(name)
            print(f"{case}: seed {seed}", flush=True)
    if kept is None:
        raise SystemExit(f"docs/rows: no rows of {name}")
    return kept[pd.MultiIndex.from_frame(kept[["case", "seed"]]).isin(runs)] if runs else kept


def seed_range(seeds: "pd.Series[int]") -> str:
    """Return the seeds as text, such as "seeds 1 to 20"."""
    first, last = seeds.min(), seeds.max()
    return f"seed {first}" if first == last else f"seeds {first} to {last}"


def kept_rows(name: str) -> pd.DataFrame | None:
    """Return the rows that are kept of a study, or None."""
    file = _FOLDER / f"{name}.csv.gz"
    return pd.read_csv(file) if file.exists() else None


def keep_rows(name: str, rows: pd.DataFrame) -> None:
    """Replace the rows of a study; equal rows give an equal file."""
    with replacing(_FOLDER / f"{name}.csv.gz") as file:
        rows.to_csv(file, index=False, compression={"method": "gzip", "mtime": 0})
