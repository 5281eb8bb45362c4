"""KRL, the language of KUKA controllers."""
