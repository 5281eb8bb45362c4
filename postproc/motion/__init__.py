"""Time: how the controller moves from one target to the next."""
