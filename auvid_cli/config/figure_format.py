"""File formats of figures, in a module of their own so that the command line starts fast."""

from enum import StrEnum


class FigureFormat(StrEnum):
    """A form of a figure's file, by the name that commands use, which is also how the file's name ends."""

    PNG = "png"
    SVG = "svg"
    PDF = "pdf"
