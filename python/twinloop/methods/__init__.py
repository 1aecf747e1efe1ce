"""How a campaign learns and asks: the paper's coevolution, or the preset `default`."""

from twinloop.methods.base import Method
from twinloop.methods.coevolution import Coevolution
from twinloop.methods.identification import IdentifyAndPlan

__all__ = ["Coevolution", "IdentifyAndPlan", "Method"]
