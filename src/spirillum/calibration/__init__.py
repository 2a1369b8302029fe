"""From observations to parameters: fits, their uncertainty, and what the data do not identify."""
