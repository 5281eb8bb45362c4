"""Calibration: measurements in, a model out; and what a model still lacks."""
