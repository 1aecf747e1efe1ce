"""The way of the preset `default`: a twin is identified, and the next flight is planned on it."""
