"""Table of random faults found by `auvid fit`, into docs/studies.md, from the runs of a campaign.

`auvid campaign fit` simulates the runs and searches for their models. Then `python -m docs.make_fit
results/campaigns/fit/tables/runs.csv` keeps its rows in docs/rows and writes the section; without a file, it writes
the section from the rows that are kept.
"""

import argparse
from pathlib import Path

import pandas as pd

from docs.resumable import keep_rows, kept_rows
from docs.section import replace_section

# Standard deviations up to which a coefficient is right, and beyond which it is wrong.
_RIGHT = 4.0
_WRONG = 5.0
_WIDER = "width of the prior"
# Additions that explain each fault of the campaign.
_EXPLAINED_BY = {
    "current": ("current",),
    "fin trim": ("trim of the fins",),
    "dvl yaw": ("scale and yaw of the DVL",),
    "dvl scale": ("scale and yaw of the DVL", "scale of the thrust"),
    "dvl arm": ("lever arm of the DVL, x",),
    "gyroscope bias": ("bias of the gyroscope",),
    "late gyroscope": ("delay of the gyroscope",),
    "late dvl": ("delay of the dvl",),
    "late inputs": ("delay of the inputs", "lag of the fins"),
    "slow fins": ("lag of the fins", "delay of the inputs"),
    "thrust": ("scale of the thrust", "scale and yaw of the DVL"),
    "ballast": ("ballast",),
    "disturbance": ("disturbance",),
    "loud gyroscope": ("noise of the gyroscope",),
    "quiet dvl": ("noise of the dvl",),
    "missing term": ("term N_|v|r", "term Y_|v|r"),
}


def _names(text: object) -> list[str]:
    return [name for name in str(text).split("; ") if name not in ("none", "nan", "")]


def _missed(faults: object, added: object) -> str:
    return "; ".join(fault for fault in _names(faults) if not {*_EXPLAINED_BY[fault]} & {*_names(added)})


def _unneeded(faults: object, added: object) -> str:
    """Return the additions of a run that explain none of its faults; a wider prior is counted by itself."""
    expected = {_WIDER, *(name for fault in _names(faults) for name in _EXPLAINED_BY[fault])}
    return "; ".join(name for name in _names(added) if name not in expected)


def _numbers(texts: pd.Series) -> str:
    """Return how often each name occurs."""
    counts = pd.Series([name for text in texts for name in _names(text)], dtype=str).value_counts()
    return ", ".join(f"{name} ({count})" for name, count in counts.items()) or "none"


def _share(of: pd.Series) -> str:
    return f"{int(of.sum())} of {len(of)}"


def section(runs: pd.DataFrame) -> str:
    """Return the text of the section."""
    ended = runs[~runs["status"].str.startswith("failed")]
    pairs = list(zip(ended["faults"], ended["additions"], strict=True))
    rows = ended.assign(
        missed=[_missed(*pair) for pair in pairs],
        unneeded=[_unneeded(*pair) for pair in pairs],
        number=[len(_names(faults)) for faults, _ in pairs],
        vehicle=ended["case"].str.split().str[0],
    )
    sound, sigmas = rows["grade"] == "sound", rows["largest_error_sigmas"]
    lines = [
        f"{len(rows)} runs, a seed each; {len(runs) - len(rows)} more could not be simulated. Right: no coefficient "
        f"beyond {_RIGHT:g} total standard deviations; wrong: one beyond {_WRONG:g}.",
        "",
        "| runs | sound and right | sound and wrong | all faults found | nothing else added | processor time |",
        "| --- | --- | --- | --- | --- | ---: |",
    ]
    groups = [(f"{n} fault{'' if n == 1 else 's'}", rows["number"] == n) for n in sorted(rows["number"].unique())]
    groups += [(vehicle, rows["vehicle"] == vehicle) for vehicle in sorted(rows["vehicle"].unique())]
    for name, own in [*groups, ("all", rows["number"] >= 0)]:
        lines.append(
            f"| {name} | {_share((sound & (sigmas <= _RIGHT))[own])} | {_share((sound & (sigmas > _WRONG))[own])} "
            f"| {_share((rows['missed'] == '')[own])} | {_share((rows['unneeded'] == '')[own])} "
            f"| {rows.loc[own, 'processor_time'].median():.0f} s |"
        )
    widened = rows["additions"].map(lambda text: _WIDER in _names(text))
    lines += [
        "",
        f"Sound: {_share(sound)}. Not found: {_numbers(rows['missed'])}. Added without need: "
        f"{_numbers(rows['unneeded'])}. Prior widened: {_share(widened)}, of remus100 "
        f"{_share(widened[rows['vehicle'] == 'remus100'])}.",
        "",
        "Not sound, or with a fault that was not found:",
        "",
        *(
            f"- seed {row.seed}, {row.case}, {row.attitude} attitude ({row.faults}): {row.grade}"
            + (f", {row.reason}" if row.grade != "sound" else "")
            + (f"; not found: {row.missed}" if row.missed else "")
            + f"; largest error {row.largest_error_sigmas:.1f} sd"
            for row in rows[~sound | (rows["missed"] != "")].itertuples()
        ),
    ]
    return "\n".join(lines)


def main() -> None:
    """Keep the rows of a campaign, if named, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="?", help="table of the runs of the campaign")
    path = parser.parse_args().runs
    if path is not None:
        keep_rows("fit", pd.read_csv(path))
    rows = kept_rows("fit")
    if rows is None:
        raise SystemExit("docs/rows: no rows of fit; name the table of the runs")
    replace_section("fit", section(rows), "studies")


if __name__ == "__main__":
    main()
