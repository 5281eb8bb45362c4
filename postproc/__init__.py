"""Offline-programming post-processor for industrial robots."""

__version__ = "0.1.0"
