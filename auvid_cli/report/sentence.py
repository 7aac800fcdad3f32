"""Remarks as sentences."""


def sentence(remark: str) -> str:
    """A remark, which begins small and ends open, with a capital letter and a full stop."""
    return f"{remark[0].upper()}{remark[1:]}."
