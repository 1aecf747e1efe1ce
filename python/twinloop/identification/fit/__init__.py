"""Fit: constants tuned on predictions, and what the runs leave open of them."""
