"""Linear analysis: laws and controllers around a point, and the margins of the loops that they close."""
