"""The campaign: ask and tell, its runs, and the two ways of learning from them."""

from twinloop.campaign.assessment import controller_to_fly
from twinloop.campaign.campaign import Campaign
from twinloop.campaign.flying import refused_an_answer
from twinloop.campaign.from_logs import identify
from twinloop.campaign.persistence import available_threads

__all__ = ["Campaign", "available_threads", "controller_to_fly", "identify", "refused_an_answer"]
