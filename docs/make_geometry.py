"""Compare four published vehicles with their geometry, into docs/theory.md: `python -m docs.make_geometry`."""

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.vehicle import VehicleSettings
from docs.section import replace_section

VEHICLES = "remus100", "vt690", "lauv", "lrauv"
# Beyond the 22 coefficients, so in no vehicle file but in its notes.
ROLL_BY_SPEED = {"vt690": -0.4307, "lrauv": -5.71}


def table() -> str:
    """Return the rows: mean and standard deviation of REMUS, and of each vehicle how far the published value is off."""
    spiral = find_experiment(None)
    vehicles = {name: load_experiment(spiral, (f"vehicle=vehicles/{name}.yaml",)).vehicle for name in VEHICLES}
    derived = {name: {each.name: each for each in vehicle.derived_values()} for name, vehicle in vehicles.items()}
    lines = [
        "| | formula | REMUS 100 by formula | published, distance: REMUS 100 | VT 690 | LAUV | LRAUV |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for symbol, first in derived[VEHICLES[0]].items():
        cells = [_cell(symbol, name, vehicles[name], derived[name][symbol]) for name in VEHICLES]
        expected = f"{first.mean:.3g} +- {first.standard_deviation:.2g} {first.unit}"
        row = f"`{symbol}`", first.formula.split(",")[0], expected, *cells
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    return "\n".join(lines)


def _cell(symbol: str, name: str, vehicle: VehicleSettings, expected) -> str:
    published = vehicle.known_parameters() | vehicle.all_coefficients()
    value = published.get(symbol, ROLL_BY_SPEED.get(name))
    if value is None:
        return ""
    distance = (value - expected.mean) / expected.standard_deviation
    text = f"{value:.3g}, {distance:+.1f}"
    return f"**{text}**" if abs(distance) > 3.0 else text


if __name__ == "__main__":
    replace_section("geometry", table(), "theory")
