"""What a search for terms shows on a terminal."""

from rich.console import Console

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.data.findings import ScoredTerm, TermFindings
from auvid_cli.report.screens import print_terms


def scored(term: str, held_out_gain: float | None, found: bool = False) -> ScoredTerm:
    return ScoredTerm(1, term, "kg/rad", "", -28.6123, 3.2, 29.1, 0.776, "", held_out_gain, 44.4, found)


def test_a_term_takes_a_line_of_a_narrow_terminal(capsys):
    rows = scored("N_|v|r", 540.0, found=True), scored("Y_|r|v", 13.8), scored("N_v", None)
    findings = TermFindings(rows, 191, ((0.0, 200.0),), ((200.0, 300.0),), load_experiment(find_experiment(None)))
    print_terms(Console(width=80), findings)
    lines = [line.split() for line in capsys.readouterr().out.splitlines() if "28.6" in line]
    assert [(line[1], line[8:]) for line in lines] == [
        ("N_|v|r", ["found"]),
        ("Y_|r|v", ["not", "kept"]),
        ("N_v", []),
    ]
