"""Second stage of a replay: navigator and identification over what the devices said, held against the record."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from typing import Any

from hindrax_bag.compare import Ledger, flat
from hindrax_bag.reader import BagMessage
from hindrax_bag.stamps import stamp_of
from hindrax_bringup.wire_replay import Parameters, knobs_of
from hindrax_control.navigator import Navigator, NavigatorKnobs
from hindrax_control.nodes.navigator import SOURCES
from hindrax_core.events import NS_PER_S, Stamp, Stamped
from hindrax_core.state import Estimate, Navigation, Thrust
from hindrax_core.topics import ALLOCATION, ESTIMATE, NAVIGATION, ODOMETRY, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.feed import Feed, Measurement, Sorter
from hindrax_ident.nodes import listen
from hindrax_ident.session import Session
from hindrax_ident.tuning import Tuning
from hindrax_ros.convert import estimate_to_msg, navigation_to_msg, odometry_to_msg, stamp_from_msg
from hindrax_ros.graph import message_class
from hindrax_ros.serialized import deserialized, serialized

NEAR_NS = NS_PER_S // 50
"""A recorded navigation state has a replayed one within a tick."""
SAME_NS = 1000
"""Times between samples are reckoned from where the identification began, and rounded: they differ by a nanosecond."""
STATE_NS = NS_PER_S // 10
"""Distance of the navigation states that are compared."""
LATEST = 1000
"""Navigation states that are kept: what was recorded of one came seldom later than a second."""
SETTLING_NS = NS_PER_S
"""In its first second the navigator finds its sensors one by one, in the order of that day."""
SAMPLE_NS = NS_PER_S
"""Distance of the samples of a reference."""
READERS = {resolved(topic): (read, topic.name.partition("/")[0]) for topic, read in SOURCES.items()}
BYTES_LISTENERS = {resolved(topic): one for topic, one in listen.AS_BYTES.items()}
SESSION_INPUTS = {resolved(topic): one for topic, one in listen.LISTENERS.items()}
NAVIGATION_NAME, ESTIMATE_NAME, ALLOCATION_NAME = resolved(NAVIGATION), resolved(ESTIMATE), resolved(ALLOCATION)
STATES: dict[str, Callable[[Stamped[Navigation]], Any]] = {
    NAVIGATION_NAME: navigation_to_msg,
    resolved(ODOMETRY): odometry_to_msg,
}
HEARD = READERS.keys() | SESSION_INPUTS.keys() | STATES.keys() | {ESTIMATE_NAME, ALLOCATION_NAME}
"""Topics that this stage takes."""
OBJECTS = HEARD - READERS.keys() - BYTES_LISTENERS.keys() - STATES.keys()
"""Those that are unpacked for it; of the others the bytes are read in place."""


class StateStage:
    """Navigator and identification. They hear what was recorded, except where the devices now say something else."""

    def __init__(
        self, vehicle: Vehicle, parameters: Parameters, ledger: Ledger, samples: dict[str, dict[str, Any]]
    ) -> None:
        self._ledger, self._samples = ledger, samples
        self._navigator = Navigator(vehicle, knobs_of(NavigatorKnobs, parameters, "navigator"))
        self._session = Session(vehicle, knobs_of(Tuning, parameters, "identifier"))
        self._sorter, self._feed = Sorter(), Feed(vehicle)
        # Each topic has its own, for a burst is recorded topic by topic.
        self._states = {topic: deque[Stamped[Navigation]](maxlen=LATEST) for topic in STATES}
        self._estimates: dict[str, list[Stamped[Estimate]]] = {}
        self._recorded_estimates: list[tuple[str, Stamp, BagMessage]] = []
        self._next_sample: dict[str, int] = {}
        self._next_state: dict[str, int] = {}

    def hear(self, message: BagMessage, replaced: bytes | None) -> None:
        """Take the next message of HEARD; `replaced` is what a device says instead."""
        topic, data = message.topic, replaced or message.data
        said: Any = None
        if topic in OBJECTS or message.form.old:
            said = deserialized(replaced, message_class(message.type)) if replaced else message.decoded()
        reader = READERS.get(topic)
        if reader is not None:
            read, source = reader
            found = self._navigator.step(read(data if said is None else serialized(said)), source)
            if found is not None:
                for states in self._states.values():
                    states.append(found)
        elif topic in STATES:
            self._check_state(message)
        elif topic == ESTIMATE_NAME:
            self._recorded_estimates.append((said.motion, stamp_from_msg(said.header.stamp), message))
        # Of the navigation it hears what was recorded: what it makes of it must be what it made on the day.
        if said is None and topic in BYTES_LISTENERS:
            self._learn(BYTES_LISTENERS[topic](data))
        elif topic in SESSION_INPUTS:
            self._learn(SESSION_INPUTS[topic](said))

    def finish(self) -> None:
        """Compare the estimates that were published."""
        for motion, estimates in self._estimates.items():
            for one in estimates:
                if self._sample_due(f"{ESTIMATE_NAME} {motion}", one.stamp):
                    values = dict(flat(estimate_to_msg(one)))
                    self._samples.setdefault(ESTIMATE_NAME, {})[f"{one.stamp} {motion}"] = values
        for motion, stamp, message in self._recorded_estimates:
            self._check_estimate(motion, stamp, message)

    def _check_estimate(self, motion: str, stamp: Stamp, message: BagMessage) -> None:
        made = self._estimates.get(motion, [])
        at = bisect_left(made, stamp - SAME_NS, key=lambda one: one.stamp)
        if at == len(made) or made[at].stamp > stamp + SAME_NS:
            self._ledger.unmatched(ESTIMATE_NAME, stamp, "recorded, not replayed", motion, "none")
            return
        data = serialized(estimate_to_msg(made[at]))
        self._ledger.compare_bytes(ESTIMATE_NAME, stamp, message.data, data, message.form.decode)

    def conclude(self) -> None:
        """Keep the results of the identification for a reference: of a motion that cannot be told they are rounding."""
        results = self._session.conclude().results
        for motion, result in results.motions.items():
            if not result.identifiable:
                continue
            values = {name: number.value for name, number in result.coefficients.items()}
            sigmas = {f"{name} std": number.std for name, number in result.coefficients.items()}
            self._samples.setdefault("results", {})[motion] = {**values, **sigmas}

    def _check_state(self, message: BagMessage) -> None:
        """Compare with the state that lies nearest: the grid of the ticks begins where the navigator was started."""
        topic, stamp = message.topic, stamp_of(message.data)
        states = self._states[topic]
        while len(states) > 1 and abs(states[1].stamp - stamp) <= abs(states[0].stamp - stamp):
            states.popleft()
        if stamp < self._next_state.setdefault(topic, stamp + SETTLING_NS):
            return
        self._next_state[topic] = stamp + STATE_NS
        if not states or abs(states[0].stamp - stamp) > NEAR_NS:
            self._ledger.unmatched(topic, stamp, "recorded, not replayed", "a message", "none")
            return
        made = dict(flat(STATES[topic](states[0])))
        self._ledger.compare_values(topic, stamp, dict(flat(message.decoded())), made)
        if self._sample_due(topic, stamp):
            self._samples.setdefault(topic, {})[str(stamp)] = made

    def _learn(self, measurement: Stamped[Measurement]) -> None:
        if isinstance(measurement.reading, Thrust):
            self._navigator.thrust(measurement.stamp, measurement.reading.forces_N)
        for sorted_ in self._sorter.push(measurement):
            for event in self._feed.step(sorted_):
                for estimate in self._session.step(event):
                    self._estimates.setdefault(estimate.reading.motion, []).append(estimate)

    def _sample_due(self, topic: str, stamp: int) -> bool:
        if stamp < self._next_sample.get(topic, 0):
            return False
        self._next_sample[topic] = stamp + SAMPLE_NS
        return True
