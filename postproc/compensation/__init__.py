"""Compensation: a program in, the same program out with corrected targets."""
