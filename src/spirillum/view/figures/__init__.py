"""Figures: one look, drawn without global state; import a module only where its figure is drawn."""
