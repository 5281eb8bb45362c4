"""Robots over years: checks, events."""
