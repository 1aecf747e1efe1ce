"""Proposals: each takes a hypothesis and gives changed ones, or none; none of them decides.

A proposal is a pure function `(context, hypothesis) -> hypotheses`. It lies in a file of its own, and on a line of
`PROPOSALS` in `searches.py`. What it gives competes by its evidence with the hypothesis that it was given. Whether it
has anything to propose it reads off that hypothesis: what is not fitted yet may get other inputs and terms, what is
fitted may be looked at again. Random numbers it draws from a unit of its own, so that a search that finds nothing
changes nothing.
"""
