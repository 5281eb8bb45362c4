"""What every target is corrected by: inverse model, rounds, agreement, decisions."""
