"""Many robots, one labelled Dataset."""
