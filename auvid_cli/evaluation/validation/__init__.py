"""How well an identified model predicts a manoeuvre that it has not seen."""
