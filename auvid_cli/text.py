"""Text for people: printable characters, hanging indents and sentences."""


def printable(text: str) -> str:
    r"""Show every sign of a text; one that cannot be seen stands as Python would write it, for example ``\x1b``."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)


def printable_lines(text: str) -> str:
    """Do the same with each line."""
    return "\n".join(map(printable, text.split("\n")))


def shortened(text: str, most: int = 300) -> str:
    """Shorten a text to so many signs at most."""
    return text if len(text) <= most else f"{text[:most]} ..."


def one_line(text: str) -> str:
    """Put a text into one printable line, with a blank wherever there is room in it."""
    return printable(" ".join(text.split()))


def sentence(remark: str) -> str:
    """Make a sentence of a remark, which begins small and ends open: a capital letter and a full stop."""
    return f"{remark[0].upper()}{remark[1:]}."
