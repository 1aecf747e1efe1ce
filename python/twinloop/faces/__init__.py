"""Faces: what people see; they show what is known and compute nothing."""
