"""What every target is corrected by, and which targets keep their values."""
