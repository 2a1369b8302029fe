"""From observations to parameters: fits, their uncertainty, and what the data cannot tell."""
