"""Evaluation -> CSV tables, printed tables, figures and the summary on the screen."""
