"""Studies of many seeds that can be interrupted: finished runs are kept in a file, one row each."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import pandas as pd

# Settings of the default experiment when these studies were made: a wide prior, and a gentle start of the spiral.
WIDE_PRIOR = "identification.prior.factor=3"
EARLIER_SPIRAL = "manoeuvre=manoeuvres/spiral_gentle.yaml", WIDE_PRIOR


class Asked(NamedTuple):
    """Number of seeds, and the file of the rows."""

    seeds: int
    rows: Path


def asked(description: str | None, name: str, seeds: int) -> Asked:
    """Read the command line of a study; `seeds` is the default number of seeds."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=seeds)
    parser.add_argument("--rows", type=Path, default=Path(f"results/studies/{name}.csv"))
    return Asked(**vars(parser.parse_args()))


def all_rows(file: Path, runs: Iterable[tuple[str, int]], found: Callable[[str, int], pd.DataFrame]) -> pd.DataFrame:
    """Do the runs (case and seed) that are not in the file yet; return all rows of the file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    done = set[tuple[str, int]]()
    if file.exists():
        done.update(pd.read_csv(file)[["case", "seed"]].itertuples(index=False, name=None))
    for case, seed in runs:
        if (case, seed) not in done:
            rows = found(case, seed).assign(case=case, seed=seed)
            rows.to_csv(file, mode="a", header=not file.exists(), index=False)
            print(f"{case}: seed {seed}", flush=True)
    return pd.read_csv(file)
