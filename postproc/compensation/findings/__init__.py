"""Findings about a compensated program: messages, headline, tolerance, times."""
