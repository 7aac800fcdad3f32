"""One thin module per command; the heavy parts are imported only when a command runs."""
