"""Text of a user's file as nothing but text: what steers a terminal, ends a line or turns it round is written out."""


def printable(text: str) -> str:
    r"""Text whose signs are all to be seen; any other stands as Python would write it, for example ``\x1b``."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)


def printable_lines(text: str) -> str:
    """The same of each line."""
    return "\n".join(map(printable, text.split("\n")))


def shortened(text: str, most: int = 300) -> str:
    """Text of so many signs at most."""
    return text if len(text) <= most else f"{text[:most]} ..."


def one_line(text: str) -> str:
    """Text as one printable line, with a blank wherever there is room in it."""
    return printable(" ".join(text.split()))
