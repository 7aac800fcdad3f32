"""Time per event by the number of states: `python -m benchmarks.states`, some five minutes.

The nine motion states and 1 to 60 coefficients, of which those beyond the 22 are terms that the vehicle does not have
(their true value is 0); and the 22 with three biases of the gyroscope, with three more of the attitude, and with three
terms that vehicles often have, estimated and known.
"""

from dataclasses import replace
from statistics import median

from benchmarks.three_terms import three_terms
from benchmarks.timing import Timed, described_machine, hold_to_one_core, round_robin
from docs.section import replace_section

_COUNTS = (1, 4, 8, 12, 16, 22, 23, 25, 28, 32, 36, 40, 48, 55, 60)
_BESIDE = {
    "22 and 6 biases": ("identification.estimate.biases=[gyro, attitude]",),
    "22 and 3 biases": ("identification.estimate.biases=[gyro]",),
    "22 and 3 terms": three_terms(estimate=True),
    "22, 3 terms known": three_terms(estimate=False),
}
_FILTERS = ("ckf", "tukf")
_ROUNDS = 9


def settings(count: int) -> tuple[str, ...]:
    """Return the settings that estimate so many coefficients."""
    from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS, admissible_terms

    symbols = [coefficient.symbol for coefficient in COEFFICIENTS[:count]]
    # Of two whose names in code are the same, one.
    beyond = list({term.identifier: term for term in admissible_terms()}.values())
    own = []
    for term in beyond[: count - len(symbols)]:
        factors = ", ".join(f'"{factor}"' for factor in term.factors)
        own.append(
            f'{{name: "{term.symbol}", row: {EQUATION_ROWS[term.row]}, factors: [{factors}], value: "0 {term.unit}"}}'
        )
        symbols.append(term.symbol)
    named = ", ".join(f'"{symbol}"' for symbol in symbols)
    return f"vehicle.terms=[{', '.join(own)}]", f"identification.coefficients=[{named}]"


def main() -> None:
    """Time all in turns, and write the table."""
    hold_to_one_core()
    from auvid_cli.config.enums import FilterName
    from auvid_cli.config.loading import find_experiment, load_experiment
    from auvid_cli.identification.prepared_data import prepare
    from auvid_cli.identification.run import set_up_filters
    from auvid_cli.simulation.simulate import simulate

    plain = load_experiment(find_experiment(None), ("manoeuvre.duration=20 s",))
    dataset = simulate(plain)
    timed: dict[tuple[str, str], Timed] = {}
    states, events = {}, {}
    cases = {str(count): settings(count) for count in _COUNTS} | _BESIDE
    for case, overrides in cases.items():
        told = load_experiment(find_experiment(None), ("manoeuvre.duration=20 s", *overrides))
        prepared = prepare(replace(dataset, experiment=told))
        for run in set_up_filters(prepared, [FilterName(name) for name in _FILTERS]):
            outcome = run.run(lambda chunk: None)
            states[case], events[case] = len(run.header.state), outcome.steps
            timed[case, run.header.filter] = Timed(lambda run=run: run.run(lambda chunk: None))
    round_robin(list(timed.values()), _ROUNDS)

    lines = [f"- {name}: {value}" for name, value in described_machine().items()]
    lines += [
        "",
        "| parameters | states | CKF, us per event | min - max | x 31 | TUKF, us per event | min - max | x 31 |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for case in cases:
        cells = []
        for name in _FILTERS:
            own, usual = timed[case, name].seconds, timed["22", name].seconds
            micro = [seconds / events[case] * 1e6 for seconds in own]
            ratio = median(a / b for a, b in zip(own, usual, strict=True))
            cells += [f"{median(micro):.2f}", f"{min(micro):.2f} - {max(micro):.2f}", f"{ratio:.2f}"]
        lines.append(f"| {case} | {states[case]} | {' | '.join(cells)} |")
    text = "\n".join(lines)
    print(text)
    replace_section("states", text)


if __name__ == "__main__":
    main()
