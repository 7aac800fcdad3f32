"""State estimation that knows of vehicles nothing but a process and a measurement model."""
