"""The campaign: ask and tell, what was told, and the two ways of learning from it."""

from twinloop.campaign.campaign import Campaign, available_threads, controller_to_fly

__all__ = ["Campaign", "available_threads", "controller_to_fly"]
