"""Figures: one look, drawn without any global state; import its modules only where something is drawn."""
