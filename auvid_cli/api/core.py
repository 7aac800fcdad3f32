"""The compiled core in two halves, which two processes can compile side by side.

The filters know nothing of vehicles, so the halves have no function in common.
"""

FILTERS = (
    "auvid_cli.filters.square_root",
    "auvid_cli.filters.least_squares",
    "auvid_cli.filters.smoother",
    "auvid_cli.filters.noise_likelihood",
)


def load_vehicles() -> None:
    """Import the compiled modules that concern vehicles; where they must be compiled first, this takes seconds."""
    import auvid_cli.identification.faults
    import auvid_cli.identification.process
    import auvid_cli.simulation.simulate  # noqa: F401
