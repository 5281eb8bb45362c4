"""Error: effects, models, fitting and solving."""
