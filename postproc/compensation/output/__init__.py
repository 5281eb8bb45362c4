"""What is written, read back, and undone: edits, records, clones."""
