"""The simulated world of one station: room, hand, and the process that wears the headset."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import ExitStack

from handcal.io.closable import Closable
from handcal.sim.hand import HandSettings, Side, make_hand
from handcal.sim.process import VirtualHeadset
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneReceiver, SceneState

_REMEMBERED = 64


class Simulation(Closable):
    """Starts the virtual headset and receives its scene.

    Parameters
    ----------
    seed : int
        Seed of wearer, hand and room.
    start_headset : callable
        Starts the process, given the port to which it sends the scene.
    side : {"left", "right"}, optional
        The hand that is raised; default: drawn from the seed.

    Attributes
    ----------
    world : World
    """

    def __init__(
        self,
        seed: int,
        start_headset: Callable[[int], VirtualHeadset],
        side: Side | None = None,
    ) -> None:
        self.world = World(make_hand(seed, HandSettings(side=side)), make_room(seed))
        self._start_headset = start_headset
        self._recent: deque[SceneState] = deque(maxlen=_REMEMBERED)
        with ExitStack() as stack:
            self._receiver = stack.enter_context(SceneReceiver())
            self._headset = start_headset(self._receiver.port)
            self._stack = stack.pop_all()

    def scene(self) -> SceneState | None:
        """Return the present state of the moving part of the world, for the simulated camera."""
        state = self._receiver.latest()
        if state is not None:
            self._recent.append(state)
        return state

    def scene_at(self, t_ns: int) -> SceneState | None:
        """Return the scene seen by the camera nearest to a time of the host's monotonic clock."""
        return min(self._recent, key=lambda state: abs(state.t_ns - t_ns), default=None)

    def require_running(self) -> None:
        """Raise LinkError if the virtual headset has ended."""
        self._headset.require_running()

    def restart(self) -> None:
        """End the virtual headset, if it is running, and start another."""
        self._headset.close()
        self._headset = self._start_headset(self._receiver.port)

    def close(self) -> None:
        """End the virtual headset; safe to call twice."""
        self._headset.close()
        self._stack.close()
