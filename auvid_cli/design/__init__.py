"""Manoeuvres that tell most: what a run will say of a vehicle before anybody makes it, and the search for the best."""
