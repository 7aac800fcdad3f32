"""What figures are written as, apart from what draws them so that a command line can name it at once."""

from enum import StrEnum


class FigureFormat(StrEnum):
    """A form of a figure's file, by the name that commands use, which is also how the file's name ends."""

    PNG = "png"
    SVG = "svg"
    PDF = "pdf"
