"""Settings of an experiment: vehicle, sensors, manoeuvre, and how to identify."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Identification, IdentificationOfVehicle
from auvid_cli.config.manoeuvre import AnyManoeuvre, Recorded
from auvid_cli.config.sensors import SensorSuite
from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Unit
from auvid_cli.config.vehicle import VehicleSettings


def move_fin_lag(data: Any) -> Any:
    """Move the lag of the fins from `identification`, where files of before have it, to the vehicle's actuators.

    Raises
    ------
    ValueError
        If the vehicle states one as well.
    """
    identification, vehicle = (
        (data.get(key) for key in ("identification", "vehicle")) if isinstance(data, dict) else (None,) * 2
    )
    if not isinstance(identification, dict) or not isinstance(vehicle, dict) or _LAG not in identification:
        return data
    rest = {key: value for key, value in identification.items() if key != _LAG}
    if not identification[_LAG]:
        return {**data, "identification": rest}
    actuators = vehicle.get("actuators") or {}
    fins = actuators.get("fins") or {}
    if "time_constant" in fins:
        raise ValueError(
            f"identification.{_LAG} and vehicle.actuators.fins.time_constant both state a lag: leave out the first"
        )
    fins = {**fins, "time_constant": identification[_LAG]}
    vehicle = {**vehicle, "actuators": {**actuators, "fins": fins}}
    return {**data, "vehicle": vehicle, "identification": rest}


# What it was called there.
_LAG = "fin_time_constant"


class RecordedFile(Settings):
    """A file of a log."""

    name: str
    sha256: str


class Recording(Settings):
    """Where an imported dataset comes from."""

    files: tuple[RecordedFile, ...]
    map: Annotated[str, Field(description="text of the map by which they were read")]
    origin: Annotated[float, Unit("s"), Field(description="time of the log at which the dataset's begins")]
    remarks: Annotated[
        dict[str, tuple[str, ...]], Field(description="what the import had to say of a sensor or input")
    ] = Field(default_factory=dict)


class RunSettings(Settings):
    """Settings of a simulated or recorded run: the vehicle, and how to identify it."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", description="folder under results/")]
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True, description="of every random stream")] = 1
    vehicle: VehicleSettings
    identification: IdentificationOfVehicle = Identification()

    @model_validator(mode="before")
    @classmethod
    def _with_lag_of_vehicle(cls, data: Any) -> Any:
        return move_fin_lag(data)

    @property
    def has_ahrs(self) -> bool:
        """Whether an AHRS computes the attitude; assumed for a recorded run."""
        return True

    def data_files(self) -> list[Path]:
        """Return the files with numbers that the settings name."""
        earlier = self.identification.prior.from_estimate
        return [] if earlier is None else [Path(earlier)]


class ImportedRun(RunSettings):
    """A run that a vehicle recorded."""

    recording: Recording


_OF_THE_PAPER = (FilterName.EKF, FilterName.CKF, FilterName.TUKF)


class Experiment(RunSettings):
    """A whole experiment file: a run to simulate."""

    sensors: SensorSuite
    manoeuvre: AnyManoeuvre

    @model_validator(mode="before")
    @classmethod
    def _filters_of_the_paper(cls, data: Any) -> Any:
        """Take the filters of the paper for a simulation that names none; what is recorded has the smoother first."""
        identification = data.get("identification", {}) if isinstance(data, dict) else None
        if not isinstance(identification, dict) or "filters" in identification:
            return data
        return {**data, "identification": {**identification, "filters": _OF_THE_PAPER}}

    @field_validator("manoeuvre")
    @classmethod
    def _inputs_of_all_terms(cls, value: AnyManoeuvre, info: ValidationInfo) -> AnyManoeuvre:
        vehicle: VehicleSettings | None = info.data.get("vehicle")
        if vehicle is not None and (lacking := value.missing_propulsion(vehicle.coefficient_set)):
            raise ValueError(lacking)
        return value

    @property
    def has_ahrs(self) -> bool:
        """Whether an AHRS computes the attitude."""
        return self.sensors.has_ahrs

    def data_files(self) -> list[Path]:
        """Return those of any run, and the inputs of a recorded manoeuvre."""
        recorded = [Path(self.manoeuvre.file)] if isinstance(self.manoeuvre, Recorded) else []
        return [*super().data_files(), *recorded]
