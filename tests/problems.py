"""Problems that nothing but candidates poses: of one run, with derivatives that are integrated."""

from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.search.problem import Problem
from twinloop.identification.starts import ANEW, begun


def problem_of(signals, run):
    context = Context([run], signals, options_of("default", {}), Unit(0), _core.Workers(1))
    return Problem(context, begun(context, "acceleration", context.first_pool(), ANEW))
