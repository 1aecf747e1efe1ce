"""Sensors: what each state is read with, when, and how the states of an output hang together."""
