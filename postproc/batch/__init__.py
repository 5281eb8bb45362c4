"""Many programs: worker processes of this machine, or a cluster."""
