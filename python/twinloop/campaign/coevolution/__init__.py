"""The way of the preset `paper`: models and tests coevolve."""

from twinloop.campaign.coevolution.method import Coevolution

__all__ = ["Coevolution"]
