"""The /diagnostics of one node: rate, rejections by reason, last trouble, identity and age as keys and values."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from hindrax_core.events import Rejected, Stamp, seconds_between
from hindrax_core.input_checks import Refusals
from hindrax_core.text.refusals import Refusal
from hindrax_core.topics import DIAGNOSTICS, Topic
from hindrax_ros.graph import publisher
from hindrax_ros.messages.convert import header


@dataclass(slots=True)
class NodeDiagnostics:
    """Counters of one device or node; `report` turns them into a status and starts a new second."""

    hardware: str = ""
    identity: str = ""
    trouble: str = ""
    troubles: int = 0
    readings: int = 0
    rejects: Counter[str] = field(default_factory=Counter)
    last_reject: str = ""
    last_reading: Stamp | None = None
    last_report: Stamp | None = None
    note: str = ""
    alarm: str = ""
    """Finding that the operator must act on, while the device itself is healthy."""
    missing: str = ""
    """Measurement that does not come while others do; empty when all do."""
    withheld: str = ""
    """Reason why an operator has it publish nothing; empty when he has not."""
    _reported_rejects: int = 0

    def reading(self, stamp: Stamp) -> None:
        """Count a valid reading."""
        self.readings += 1
        self.last_reading = stamp

    def reject(self, rejected: Rejected) -> None:
        """Count rejected bytes by the key of their reason."""
        self.rejects[rejected.key] += 1
        self.last_reject = rejected.reason

    def troubled(self, text: str) -> None:
        """Set the last trouble, for the operator."""
        self.trouble = text
        self.troubles += 1

    def report(self, name: str, now: Stamp, stale_s: float) -> DiagnosticStatus:
        """Return the status since the last report.

        Parameters
        ----------
        name
            Of the status.
        now
            Time of the node.
        stale_s : [s]
            A reading older than this is an error.

        Returns
        -------
        DiagnosticStatus
            With the rate of readings, and counts of rejects by their reasons.
        """
        elapsed = seconds_between(self.last_report, now) if self.last_report is not None else 0.0
        rate = self.readings / elapsed if elapsed > 0.0 else 0.0
        age = seconds_between(self.last_reading, now) if self.last_reading is not None else float("inf")
        level, message = self._verdict(age, stale_s)
        self.readings, self.last_report, self._reported_rejects = 0, now, self.rejects.total()
        values = {
            "identity": self.identity,
            "rate [Hz]": f"{rate:.1f}",
            "age [s]": f"{age:.3f}",
            "rejects": str(sum(self.rejects.values())),
            **({"last reject": self.last_reject} if self.last_reject else {}),
            "troubles": str(self.troubles),
            "last trouble": self.trouble,
            **{f"rejected: {reason}": str(count) for reason, count in sorted(self.rejects.items())},
        }
        return status(name, level, message, values, hardware=self.hardware)

    @property
    def _rejecting(self) -> bool:
        """Whether something was rejected since the last report."""
        return self.rejects.total() > self._reported_rejects

    def _verdict(self, age: float, stale_s: float) -> tuple[bytes, str]:
        if self.withheld:
            return DiagnosticStatus.WARN, self.withheld
        if not self.identity:
            return DiagnosticStatus.ERROR, self.trouble or "has not answered yet"
        if age > stale_s:
            since = f"for {age:.1f} s" if self.last_reading is not None else "since it answered"
            told = f"all are rejected, the last: {self.last_reject}" if self._rejecting else "line is silent"
            return DiagnosticStatus.ERROR, f"no reading {since}; {self.trouble or told}"
        if self.missing or self.alarm:
            return DiagnosticStatus.ERROR, self.missing or self.alarm
        return DiagnosticStatus.OK, self.note or "measuring"


def status(name: str, level: bytes, message: str, values: Mapping[str, str], *, hardware: str = "") -> DiagnosticStatus:
    """Make one status.

    Parameters
    ----------
    name, level, message
        As diagnostic_msgs has them.
    values
        Keys and values.
    hardware
        Identity of a device; empty: none.

    Returns
    -------
    DiagnosticStatus
        For a DiagnosticArray.
    """
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(name=name, level=level, message=message, values=pairs, hardware_id=hardware)


class DiagnosticsPublisher:
    """Publishes statuses of one node on /diagnostics, with the `refusals` of what others sent."""

    def __init__(self, node: Node, refusals: Refusals | None = None) -> None:
        self._name, self._node = f"hindrax: {node.get_name()}", node
        self.refusals = refusals or Refusals()
        self._publisher = publisher(node, DIAGNOSTICS)

    def refuse(self, topic: Topic, why: Refusal) -> None:
        """Count a refused message and log it; the next report shows the count."""
        self._node.get_logger().warning(f"refused: {self.refusals.add(topic.name, why)}", throttle_duration_sec=1.0)

    def report(
        self,
        now: Stamp,
        wrong: Sequence[str],
        well: str,
        values: Mapping[str, str],
        level: bytes = DiagnosticStatus.WARN,
    ) -> None:
        """Publish the status of the node itself.

        Parameters
        ----------
        now
            Its stamp.
        wrong
            Sentences; with one, or with a new refusal, it has this level.
        well
            A word for a node with nothing wrong.
        values
            Keys and values; refusals are added.
        level
            Of what is wrong.
        """
        text = "; ".join([*wrong, *self.refusals.new_refusals()])
        values = {**values, **self.refusals.values()}
        self.publish(now, status(self._name, level if text else DiagnosticStatus.OK, text or well, values))

    def publish(self, now: Stamp, *statuses: DiagnosticStatus) -> None:
        """Publish them with this stamp."""
        self._publisher.publish(DiagnosticArray(header=header(now), status=list(statuses)))
