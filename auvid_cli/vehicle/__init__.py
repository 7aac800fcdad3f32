"""The physics: coefficients, mass and Coriolis matrices, kinematics, dynamics."""
