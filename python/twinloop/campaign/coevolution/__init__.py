"""The way of the preset `paper`: models and tests coevolve."""
