"""Second stage of a replay: navigator and identification over the replayed readings, compared with the record."""

from bisect import bisect_left
from collections import deque
from collections.abc import Iterable

from hindrax_bag.message_comparison import ComparisonReport
from hindrax_bag.read.bag_reader import BagMessage, stamp_of
from hindrax_control.navigation.navigator import Navigator, NavigatorKnobs
from hindrax_control.nodes.navigator_node import sources
from hindrax_core.events import NS_PER_S, Stamp, Stamped
from hindrax_core.signals import Estimate, IdentEvent, Navigation, Thrust
from hindrax_core.topics import DIAGNOSTICS, ESTIMATE, NAVIGATION, ODOMETRY, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.nodes.measurement_messages import readers
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import DROPPED, Feed, Measurement
from hindrax_ident.tuning import Tuning
from hindrax_replay.recorded_devices import Parameters, knobs_of, prefix_of
from hindrax_replay.wire_stage import ReferenceSamples, compare_lazily
from hindrax_ros.messages.convert import estimate_to_msg
from hindrax_ros.messages.fast_serialization import navigation_writer, odometry_writer
from hindrax_ros.messages.serialization import current_bytes, deserialized, message_class

NEAR_NS = NS_PER_S // 50
"""A recorded navigation state has a replayed one within a tick."""
SAME_NS = 1000
"""Sample times count from the start of the identification and are rounded: they differ by a nanosecond."""
STATE_NS = NS_PER_S // 10
"""Distance of the navigation states that are compared."""
LATEST = 1000
"""Navigation states kept: recorded messages are rarely later than a second."""
SETTLING_NS = NS_PER_S
"""In its first second the navigator receives its sensors one by one, in the order of that day."""
ESTIMATE_NAME, DIAGNOSTICS_NAME = resolved(ESTIMATE), resolved(DIAGNOSTICS)
STATES = (resolved(NAVIGATION), resolved(ODOMETRY))


def inputs(vehicle: Vehicle) -> frozenset[str]:
    """Input topics of this stage."""
    read = {resolved(topic) for topic in (*sources(vehicle), *readers(vehicle))}
    return frozenset({*read, *STATES, ESTIMATE_NAME, DIAGNOSTICS_NAME})


class StateStage:
    """Navigator and identification, fed with the recorded messages or their replacements from the first stage."""

    def __init__(
        self, vehicle: Vehicle, parameters: Parameters, ledger: ComparisonReport, samples: ReferenceSamples
    ) -> None:
        self._ledger, self._samples = ledger, samples
        self._sensors = {resolved(topic): found for topic, found in sources(vehicle).items()}
        self._measurements = {resolved(topic): read for topic, read in readers(vehicle).items()}
        self._navigator = Navigator(vehicle, knobs_of(NavigatorKnobs, parameters, "navigator"))
        tuning = knobs_of(Tuning, parameters, "identifier")
        self._feed, self._session = Feed(vehicle, tuning), Session(vehicle, tuning)
        frames = prefix_of(parameters, "navigator")
        self._writers = dict(zip(STATES, (navigation_writer(frames), odometry_writer(frames)), strict=True))
        self._prefix = prefix_of(parameters, "identifier")
        # One queue per topic, for a burst is recorded topic by topic.
        self._states = {topic: deque[Stamped[Navigation]](maxlen=LATEST) for topic in STATES}
        self._pending = {topic: deque[BagMessage]() for topic in STATES}
        """Recorded states that came before the samples that they were made of: those have a way of their own."""
        self._estimates: dict[str, list[Stamped[Estimate]]] = {}
        self._recorded_estimates: list[tuple[str, Stamp, BagMessage]] = []
        self._dropped = 0
        """Measurements that came too late for the identifier of that day."""
        self._next_state: dict[str, int] = {}

    def feed(self, message: BagMessage, replaced: bytes | None) -> None:
        """Feed the next message of `inputs`; `replaced` is its replacement, if any."""
        topic, data = message.topic, replaced or current_bytes(message)
        if topic in self._sensors:
            source, read = self._sensors[topic]
            found = self._navigator.step(read(data), source)
            if found is not None:
                for name, states in self._states.items():
                    states.append(found)
                    self._check_states(name)
        elif topic in STATES:
            self._pending[topic].append(message)
            self._check_states(topic)
        elif topic == ESTIMATE_NAME:
            self._recorded_estimates.append((message.decoded().motion, Stamp(stamp_of(data)), message))
        elif topic == DIAGNOSTICS_NAME:
            pairs = (pair for status in message.decoded().status for pair in status.values)
            self._dropped = max(self._dropped, *(int(pair.value) for pair in pairs if pair.key == DROPPED), 0)
        # The identification gets the recorded navigation: its result must equal that of the day.
        if topic in self._measurements:
            self._identify(self._measurements[topic](data))

    def finish(self) -> None:
        """Compare the estimates that were published, and what is left of the states."""
        for topic in STATES:
            self._check_states(topic, last=True)
        self._learn(self._feed.flush())
        for motion, estimates in self._estimates.items():
            for one in estimates:
                if self._samples.due(f"{ESTIMATE_NAME} {motion}", one.stamp):
                    self._samples.keep(ESTIMATE_NAME, f"{one.stamp} {motion}", estimate_to_msg(one, self._prefix))
        for motion, stamp, message in self._recorded_estimates:
            made = self._estimates.get(motion, [])
            at = bisect_left(made, stamp - SAME_NS, key=lambda one: one.stamp)
            if at == len(made) or made[at].stamp > stamp + SAME_NS:
                self._ledger.unmatched(ESTIMATE_NAME, stamp, "recorded, not replayed", motion, "none")
                continue
            compare_lazily(self._ledger, message, stamp, estimate_to_msg(made[at], self._prefix))
        if self._dropped > self._feed.dropped:
            why = f"{self._dropped} measurements came too late for the live identifier on a busy machine"
            self._ledger.explain(ESTIMATE_NAME, f"{why}; `identify` uses them")

    def keep_results(self) -> None:
        """Store the identified coefficients for a reference; those of unidentifiable motions are rounding."""
        results = self._session.finalize().results
        for motion, result in results.motions.items():
            if not result.identifiable:
                continue
            values = {name: number.value for name, number in result.coefficients.items()}
            sigmas = {f"{name} std": number.std for name, number in result.coefficients.items()}
            self._samples.setdefault("results", {})[motion] = {**values, **sigmas}

    def _check_states(self, topic: str, *, last: bool = False) -> None:
        """Compare the recorded states that the replayed ones have reached."""
        pending, states = self._pending[topic], self._states[topic]
        while pending and (last or (states and states[-1].stamp >= stamp_of(pending[0].data))):
            self._check_state(pending.popleft())

    def _check_state(self, message: BagMessage) -> None:
        """Compare with the nearest state: the tick grid begins where the navigator was started."""
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
        made = deserialized(self._writers[topic](states[0]), message_class(message.type))
        self._ledger.compare_messages(topic, stamp, message.decoded(), made)
        if self._samples.due(topic, stamp):
            self._samples.keep(topic, stamp, made)

    def _identify(self, measurement: Stamped[Measurement]) -> None:
        if isinstance(measurement.reading, Thrust):
            self._navigator.thrust(measurement.reading.forces_N)
        self._learn(self._feed.step(measurement))

    def _learn(self, events: Iterable[Stamped[IdentEvent]]) -> None:
        for event in events:
            for estimate in self._session.step(event):
                self._estimates.setdefault(estimate.reading.motion, []).append(estimate)
