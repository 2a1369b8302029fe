"""BioRob 2012: sixteen helical tails in two channels."""
