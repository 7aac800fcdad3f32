"""The filters that auvid has, apart from their settings so that a command line can name them at once."""

from enum import StrEnum


class FilterName(StrEnum):
    """A filter by the name that commands, settings and files use."""

    EKF = "ekf"
    CKF = "ckf"
    TUKF = "tukf"
    UKF = "ukf"
