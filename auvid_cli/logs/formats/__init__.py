"""Logs as files of their kind hold them: named tables of named columns."""
