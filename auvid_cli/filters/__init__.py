"""State estimation for any process and measurement model."""
