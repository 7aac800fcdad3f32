"""Manoeuvre -> true motion -> raw sensors -> attitude reference."""
