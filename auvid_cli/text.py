"""Text for users: printable characters, single lines and sentences."""


def printable(text: str) -> str:
    r"""Return a text with characters that cannot be displayed written as escapes, for example ``\x1b``."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)


def printable_lines(text: str) -> str:
    """Return a text of several lines with characters that cannot be displayed written as escapes."""
    return "\n".join(map(printable, text.split("\n")))


def shortened(text: str, limit: int = 300) -> str:
    """Return a text, cut after `limit` characters."""
    return text if len(text) <= limit else f"{text[:limit]} ..."


def one_line(text: str) -> str:
    """Return a text in one printable line, with single blanks between words."""
    return printable(" ".join(text.split()))


def sentence(remark: str) -> str:
    """Return a remark with a capital letter and a full stop."""
    return f"{remark[0].upper()}{remark[1:]}."
