"""Long programs in windows, in several processes; several programs at once."""
