"""Performance figures after ISO 9283: definitions, readings, figures, program."""
