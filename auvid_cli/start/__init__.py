"""First folder of a user, by `auvid init`: vehicle, sensors, experiment, map and next steps."""
