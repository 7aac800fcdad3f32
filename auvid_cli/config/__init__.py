"""YAML to validated, unit-aware, immutable settings."""
