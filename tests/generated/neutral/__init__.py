"""Random programs in no language: printed in RAPID and KRL, and run by a small tree walk."""
