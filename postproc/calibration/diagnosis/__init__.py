"""Tracing a residual to the effect that a model lacks."""
