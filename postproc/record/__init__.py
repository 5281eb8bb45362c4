"""The record of a robot: its models, checks and events, and what follows from them."""
