"""Remarks as sentences."""


def sentence(remark: str) -> str:
    """Make a sentence of a remark, which begins small and ends open: a capital letter and a full stop."""
    return f"{remark[0].upper()}{remark[1:]}."
