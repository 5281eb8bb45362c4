"""The arm: kinematics, cell, states and arrival direction."""
