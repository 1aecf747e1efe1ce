"""Tables of the report, as plain rows of numbers and texts."""
