"""Robot program text: parsing, control flow, and rewriting without loss."""
