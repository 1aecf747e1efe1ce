"""A twin taken away: a Python function, C, SymPy, LaTeX and JSON, each checked against the twin when it is made."""
