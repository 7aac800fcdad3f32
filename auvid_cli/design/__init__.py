"""Search for the most informative manoeuvre, by the accuracy of the coefficients that is expected after a run."""
