"""Figures of a campaign: plain values first, then drawn as SVG that a page, a notebook and a paper share."""
