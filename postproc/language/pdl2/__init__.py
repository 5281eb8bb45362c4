"""Comau PDL2: its statements, its variable files, and what a program does."""
