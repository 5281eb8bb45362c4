"""Verify: a second opinion by Pinocchio, toppra and ruckig."""
