"""Whether what a record says is about states, commands and nodes that there are."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.errors import InvalidInput
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals


def check_places(
    where: str,
    signals: Signals,
    pool: Pool,
    sums: Sequence[Sum],
    chains: Sequence[Chain],
    actuation: Actuation,
) -> None:
    """Refuses numbers of states, commands and nodes that there are not.

    Args:
        where: the place in a record.
        signals: of the system.
        pool: of the nodes.
        sums: of them.
        chains: of states, beside those of the sums.
        actuation: between the commands and a model.

    Raises:
        InvalidInput: there is such a number.
    """
    states = [state for chain in (*chains, *(found.chain for found in sums)) for state in chain.states]
    states += [state for hidden in actuation.hidden for state in hidden.states]
    commands = [command for hidden in actuation.hidden for command in hidden.commands]
    nodes = [node for found in sums for subset in found.subsets for node in subset.terms]
    fits = (
        _below(signals.n_x, states)
        and _below(signals.n_u, commands)
        and _below(len(pool), nodes)
        and len(actuation.actuators) == signals.n_u
        and pool.inputs == signals.n_x + signals.n_u
    )
    if not fits:
        raise InvalidInput(
            f"Record {where}: expected states, commands and nodes that there are, found others; it belongs to other"
            " signals, or is damaged."
        )


def _below(limit: int, places: Sequence[int]) -> bool:
    return all(0 <= place < limit for place in places)
