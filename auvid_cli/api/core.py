"""The compiled core in two halves, which two processes can compile side by side.

The filters know nothing of vehicles, so the halves have no function in common.
"""

FILTERS = (
    "auvid_cli.filters.square_root",
    "auvid_cli.filters.information",
    "auvid_cli.filters.smoother",
    "auvid_cli.filters.noise_likelihood",
)


def load_vehicles() -> None:
    """Load, and compile where it has to be, what has to do with vehicles."""
    import auvid_cli.identification.faults
    import auvid_cli.identification.free_motion
    import auvid_cli.identification.process  # noqa: F401


def load_sensors() -> None:
    """Load what nonlinear sensors measure, which is else compiled when data first need it.

    For commands that would need it while they compute, where the compiler swallows an interrupt and nobody says so.
    """
    import auvid_cli.identification.observation  # noqa: F401
