"""From recorded runs to a model of readable equations, and a committee of plausible ones."""
