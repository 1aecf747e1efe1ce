"""The way of the preset `default`: a twin is identified, the next flight is planned on it."""

from twinloop.campaign.identify_and_plan.method import IdentifyAndPlan

__all__ = ["IdentifyAndPlan"]
