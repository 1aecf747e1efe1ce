"""Checks of what was recorded, before anything is learnt from it: readings, declared derivatives, commands."""
