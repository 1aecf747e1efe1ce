"""Plants different in kind that nobody tuned on, and what the preset `default` makes of them as it comes."""
