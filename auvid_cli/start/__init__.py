"""A folder to begin with: a vehicle, sensors, an experiment, a map, and what to do next."""
