"""Three additional terms that many vehicles have, as settings of an experiment."""

_TERMS = {"N_|v|r": ("N", '["|v|", r]'), "K_up": ("K", "[u, p]"), "Y_|v|r": ("Y", '["|v|", r]')}


def three_terms(*, estimate: bool) -> tuple[str, ...]:
    """Return the settings that add the terms with value 0, estimated or fixed."""
    terms = [
        f'{{name: "{name}", row: {row}, factors: {factors}, value: 0, estimate: {str(estimate).lower()}}}'
        for name, (row, factors) in _TERMS.items()
    ]
    return (f"vehicle.terms=[{', '.join(terms)}]",)
