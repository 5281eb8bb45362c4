"""Which targets must stay, and why: flags, orientation, arcs, guards."""
