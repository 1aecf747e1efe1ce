"""Terms: expressions that may be in a law, from libraries, from evolution, and from what a user knows."""
