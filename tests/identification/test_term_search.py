"""A term that the model lacks is found, with its size; where none is missing, none is."""

from dataclasses import replace

import pytest

from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.errors import DataError
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.terms import search_terms

TRUE = -1500.0
PLANTED = f'vehicle.terms=[{{name: "N_|v|r", row: N, factors: ["|v|", r], value: {TRUE}}}]'


@pytest.fixture(scope="module")
def planted(multisine_with):
    """Data of a vehicle with the term, and the model without."""
    return _without_terms(multisine_with(PLANTED, "manoeuvre.duration=20 s"))


def _without_terms(dataset):
    vehicle = dataset.experiment.vehicle.model_copy(update={"terms": ()})
    return replace(dataset, experiment=dataset.experiment.model_copy(update={"vehicle": vehicle}))


@pytest.fixture(scope="module")
def findings(planted):
    return search_terms(prepare(planted), max_terms=2)


@pytest.mark.slow
def test_missing_term_is_found_and_sized(findings):
    (first,) = findings.found
    assert first.term == "N_|v|r"
    assert first.unit == "kg*m/rad"
    assert abs(first.size - TRUE) < 4.0 * first.standard_deviation < 0.4 * abs(TRUE)
    assert first.evidence_gain > first.held_out_gain > 10.0
    assert 0.0 < first.made_up_share < 1.0


@pytest.mark.slow
def test_written_settings_estimate_the_term(findings, planted, tmp_path):
    file = tmp_path / "terms.yaml"
    file.write_text(findings.settings(), encoding="utf-8")
    (term,) = parse_run(dump_experiment(planted.experiment), "test", (str(file),)).vehicle.terms
    assert (term.name, term.factors, term.value) == ("N_|v|r", ("|v|", "r"), None)
    assert "N_|v|r" in findings.experiment.identification.estimated(findings.experiment.vehicle)


@pytest.mark.slow
def test_correlated_candidates_are_fitted_too(findings):
    tried = {term.term: term.evidence_gain for term in findings.scored if term.look == 1 and term.evidence_gain}
    assert max(tried, key=lambda name: tried[name]) == "N_|v|r" != "N_|r|v" in tried


@pytest.mark.slow
def test_search_ends_without_further_terms(findings):
    assert [term.term for term in findings.found] == ["N_|v|r"]
    second = [term for term in findings.scored if term.look == 2]
    assert second
    assert "N_|v|r" not in {term.term for term in second}
    assert max(term.gain for term in second) == second[0].gain


def test_search_without_convergence_is_refused(multisine_with, with_settings):
    dataset = with_settings(multisine_with(), "identification.smoother.max_passes=1")
    with pytest.raises(DataError, match="does not converge"):
        search_terms(prepare(dataset))
