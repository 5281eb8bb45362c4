"""Between the targets: path accuracy predicted, measured, and corrected by points."""
