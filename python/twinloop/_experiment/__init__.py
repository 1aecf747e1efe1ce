"""What a flight meets: limits, an envelope, excitation that is held back, commands that are replayed."""
