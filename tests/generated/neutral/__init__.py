"""Random programs in no language: written in RAPID and KRL, run by a walk of them."""
