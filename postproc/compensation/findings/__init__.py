"""What is said of a compensated program beside its numbers."""
