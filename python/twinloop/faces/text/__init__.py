"""The result of a campaign as text."""

from twinloop.faces.text.result import render
from twinloop.faces.text.table import cell, table
from twinloop.faces.text.verdict import verdict
from twinloop.faces.text.words import counted, held_at, predicted_flights, quality_words

__all__ = ["cell", "counted", "held_at", "predicted_flights", "quality_words", "render", "table", "verdict"]
