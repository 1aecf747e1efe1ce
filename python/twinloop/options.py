"""Options of the presets: what `Campaign.options` gives back, and what `Campaign(options=...)` may change."""

from twinloop.campaign.presets import PRESETS, DefaultOptions, Options
from twinloop.identification.settings import IdentificationOptions
from twinloop.planning.settings import PlanningOptions

__all__ = ["PRESETS", "DefaultOptions", "IdentificationOptions", "Options", "PlanningOptions"]
