"""Tests of what follows programs."""
