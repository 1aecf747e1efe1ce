"""Inputs: what a law sees of commands, through actuators and hidden states."""
