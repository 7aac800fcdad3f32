"""Table of the studies with their commands and kept rows, into docs/studies.md: `python -m docs.make_rows`."""

import pandas as pd

from docs.resumable import RUN_TIME, kept_rows
from docs.section import replace_section

# Names of the files in docs/rows of each command; a campaign's command needs the runs of `auvid campaign NAME`.
STUDIES: dict[str, tuple[str, ...]] = {
    "make_paper": ("paper",),
    "make_studies": ("seeds", "manoeuvres"),
    "make_biased": ("biased",),
    "make_undisturbed": ("undisturbed",),
    "make_coloured": ("coloured",),
    "make_field": ("field", "field_doubts", "steered"),
    "make_field_fit": ("field_fit",),
    "make_tune": ("tune",),
    "make_disturbance": ("disturbance", "disturbance_chosen"),
    "make_mismatch": ("mismatch",),
    "make_mutations": ("mutations",),
    "make_units": ("units",),
    "make_late": ("late",),
    "make_judgement": ("judgement",),
    "make_design": ("design", "design_runs"),
    "make_regimes": ("regimes",),
    "make_terms": ("terms",),
    "make_fit": ("fit",),
    "make_tolerances": ("tolerances",),
    "make_faults": ("faults",),
    "make_prior": ("prior",),
}
_CAMPAIGNS = {"make_paper", "make_biased", "make_coloured", "make_judgement", "make_regimes", "make_fit"}


def runs_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each run."""
    keys = [key for key in ("run", "case", "filter", "seed") if key in rows]
    return rows.drop_duplicates(["run"] if "run" in rows else keys)


def line(command: str, name: str) -> str:
    """Return the row of the table for a file of rows."""
    campaign = f"`auvid campaign {name}`, " if command in _CAMPAIGNS else ""
    start, rows = f"| {campaign}`python -m docs.{command}`", kept_rows(name)
    if rows is None:
        return f"{start} | none ({name}) | - | - | - |"
    runs = runs_of(rows)
    time = next((column for column in (RUN_TIME, "processor_time") if column in runs), None)
    per_run = f"{runs[time].mean():.3g}" if time else "-"
    return f"{start} | `{name}.csv.gz` | {runs['seed'].nunique()} | {len(runs)} | {per_run} |"


def table() -> str:
    """Return the table."""
    lines = [
        "| command | rows in docs/rows | seeds | runs | processor time of a run, s |",
        "| --- | --- | ---: | ---: | ---: |",
        *(line(command, name) for command, names in STUDIES.items() for name in names),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    replace_section("rows", table(), "studies")
