"""Study: are missing terms found? Writes docs/studies.md: `python -m docs.make_terms`, an hour.

Each seed is simulated once with the model's own terms, and once with each of six terms that the model lacks. Rows are
kept; finished seeds are not repeated.
"""

from dataclasses import replace

import pandas as pd

import auvid_cli as auvid
from auvid_cli.identification.states import natural_magnitude
from auvid_cli.vehicle.coefficients import EQUATION_ROWS, Coefficient, term
from docs.resumable import WIDE_PRIOR, all_rows, asked_seeds
from docs.section import replace_section

_SETTINGS = (
    "manoeuvre=manoeuvres/multisine.yaml",
    "manoeuvre.duration=90 s",
    "manoeuvre.initial_speed=3.9 m/s",
    "sensors.gyroscope={rate: 20 Hz, noise: 0.1 deg/s}",
    "sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}",
    "sensors.dvl={rate: 5 Hz, noise: 0.5 cm/s}",
)
# Row of the equations, factors, and size relative to the natural magnitude.
_PLANTED = (
    (5, ("|v|", "r"), -1.0),
    (1, ("|v|", "r"), -1.0),
    (3, ("u", "p"), -1.0),
    (0, ("v", "v"), -1.0),
    (5, ("r",), -1.0),
    (4, ("q",), -1.0),
)
_NONE = "none"
_CASES: dict[str, tuple[Coefficient | None, float]] = {_NONE: (None, 0.0)}
_CASES |= {t.symbol: (t, share) for row, factors, share in _PLANTED for t in [term(row, factors)]}


def found(planted: Coefficient | None, share: float, seed: int) -> pd.DataFrame:
    """Look for terms in one seed: the terms that were found, with their sizes, in one row."""
    told = auvid.load_experiment("spiral", WIDE_PRIOR, *_SETTINGS, f"seed={seed}")
    value, true = 0.0, told
    if planted is not None:
        value = share * natural_magnitude(planted, told.vehicle.size)
        factors = ", ".join(f'"{factor}"' for factor in planted.factors)
        own = f'vehicle.terms=[{{name: "{planted.symbol}", row: {EQUATION_ROWS[planted.row]}, factors: [{factors}], '
        true = auvid.load_experiment(
            "spiral", WIDE_PRIOR, *_SETTINGS, f"seed={seed}", f'{own}value: "{value!r} {planted.unit}"}}]'
        )
    findings = auvid.find_terms(replace(auvid.simulate(true), experiment=told))
    first = next(iter(findings.found), None)
    row = {
        "true": value,
        "found": " ".join(each.term for each in findings.found),
        "size": None if first is None else first.size,
        "standard_deviation": None if first is None else first.standard_deviation,
        "alike": "" if first is None else first.like.replace(",", ""),
        "made_up": findings.scored[0].made_up_share,
    }
    return pd.DataFrame([row])


def table(rows: pd.DataFrame) -> list[str]:
    """Return for each planted term how often it was found, alone or with others, and the error of its size."""
    lines = [
        "| missing term | seeds | found | found first, no other | a similar term found first | nothing found "
        "| largest error of the size / sd |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for planted, each in rows.fillna({"found": "", "alike": ""}).groupby("case", sort=False):
        names = each["found"].str.split()
        there = sum(planted in found for found in names)
        alone = sum(list(found) == [planted] for found in names)
        alike = sum(
            bool(found) and found[0] != planted and planted in other.split()
            for found, other in zip(names, each["alike"], strict=True)
        )
        nothing, shown = sum(not found for found in names), str(planted).replace("|", r"\|")
        if planted == _NONE:
            lines.append(f"| none | {len(each)} | - | - | - | {nothing} | - |")
        else:
            first = each[names.str[0] == planted]
            error = ((first["size"] - first["true"]).abs() / first["standard_deviation"]).max()
            lines.append(f"| `{shown}` | {len(each)} | {there} | {alone} | {alike} | {nothing} | {error:.1f} |")
    return lines


def main() -> None:
    """Go through all seeds and write the section."""
    seeds = asked_seeds(__doc__, 20)
    runs = [(name, seed) for seed in range(1, seeds + 1) for name in _CASES]
    rows = all_rows("terms", runs, lambda name, seed: found(*_CASES[name], seed))
    replace_section("terms", "\n".join(table(rows)), "studies")


if __name__ == "__main__":
    main()
