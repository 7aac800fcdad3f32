"""Settings of an experiment: vehicle, sensors, manoeuvre and identification."""

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.enums import FilterName
from auvid_cli.config.identification import Identification, IdentificationOfVehicle
from auvid_cli.config.manoeuvre import AnyManoeuvre, Recorded
from auvid_cli.config.sensors import SensorSuite
from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Unit
from auvid_cli.config.vehicle import VehicleSettings

# Old key of the lag of the fins in `identification`.
_LAG = "fin_time_constant"
RunName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", description="folder under results/")]


class WithVehicle(Settings):
    """Settings that have those of a vehicle and of its identification."""

    @model_validator(mode="before")
    @classmethod
    def _move_fin_lag(cls, data: Any) -> Any:
        """Move the lag of the fins from `identification`, as in old files, to the vehicle's actuators."""
        if not isinstance(data, dict):
            return data
        identification, vehicle = data.get("identification"), data.get("vehicle")
        if not isinstance(identification, dict) or not isinstance(vehicle, dict) or _LAG not in identification:
            return data
        rest = {key: value for key, value in identification.items() if key != _LAG}
        if not identification[_LAG]:
            return {**data, "identification": rest}
        actuators = vehicle.get("actuators") or {}
        fins = actuators.get("fins") or {}
        if "time_constant" in fins:
            stated = "the lag is already in vehicle.actuators.fins.time_constant"
            raise ValueError(f"identification.{_LAG}: {stated}; leave out the first")
        fins = {**fins, "time_constant": identification[_LAG]}
        vehicle = {**vehicle, "actuators": {**actuators, "fins": fins}}
        return {**data, "vehicle": vehicle, "identification": rest}


class RecordedFile(Settings):
    """A file of a log."""

    name: str
    sha256: str


class Recording(Settings):
    """Source of an imported dataset."""

    files: tuple[RecordedFile, ...]
    map: Annotated[str, Field(description="text of the map")]
    origin: Annotated[float, Unit("s"), Field(description="time of the log at the start of the dataset")]
    remarks: Annotated[dict[str, tuple[str, ...]], Field(description="remarks of the import, by sensor or input")] = (
        Field(default_factory=dict)
    )


class RunSettings(WithVehicle):
    """Settings of a simulated or recorded run: vehicle and identification."""

    name: RunName
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True, description="seed of all random streams")] = 1
    vehicle: VehicleSettings
    identification: IdentificationOfVehicle = Identification()

    @property
    def has_ahrs(self) -> bool:
        """Whether an AHRS computes the attitude; assumed for a recorded run."""
        return True

    @property
    def has_inertial(self) -> bool:
        """Whether accelerometer and magnetometer may be recorded, so that the filter can do without an AHRS."""
        return True

    def with_identification(self, **changes: object) -> Self:
        """Return the settings with changes below `identification`, which are not validated."""
        return self.model_copy(update={"identification": self.identification.model_copy(update=changes)})

    def with_estimate(self, **changes: object) -> Self:
        """Return the settings with changes below `identification.estimate`, which are not validated."""
        return self.with_identification(estimate=self.identification.estimate.model_copy(update=changes))

    def data_files(self) -> list[Path]:
        """Return the data files that the settings name."""
        earlier = self.identification.prior.from_estimate
        return [] if earlier is None else [Path(earlier)]


class ImportedRun(RunSettings):
    """A recorded run."""

    recording: Recording

    @property
    def has_inertial(self) -> bool:
        """Whether the map of the log has both."""
        return all(f"{sensor}:" in self.recording.map for sensor in ("accelerometer", "magnetometer"))


_OF_THE_PAPER = (FilterName.EKF, FilterName.CKF, FilterName.TUKF)


class Experiment(RunSettings):
    """An experiment file: a run to simulate."""

    sensors: SensorSuite
    manoeuvre: AnyManoeuvre

    @model_validator(mode="before")
    @classmethod
    def _filters_of_the_paper(cls, data: Any) -> Any:
        """Set the default of a simulation: the filters of the paper."""
        identification = data.get("identification", {}) if isinstance(data, dict) else None
        if not isinstance(identification, dict) or "filters" in identification:
            return data
        return {**data, "identification": {**identification, "filters": _OF_THE_PAPER}}

    @field_validator("manoeuvre")
    @classmethod
    def _inputs_for_all_terms(cls, value: AnyManoeuvre, info: ValidationInfo) -> AnyManoeuvre:
        vehicle: VehicleSettings | None = info.data.get("vehicle")
        if vehicle is not None and (message := value.missing_propulsion(vehicle.coefficient_set)):
            raise ValueError(message)
        return value

    @property
    def has_ahrs(self) -> bool:
        """Whether an AHRS computes the attitude."""
        return self.sensors.has_ahrs

    def data_files(self) -> list[Path]:
        """Return the data files, with the inputs of a recorded manoeuvre."""
        recorded = [Path(self.manoeuvre.file)] if isinstance(self.manoeuvre, Recorded) else []
        return [*super().data_files(), *recorded]
