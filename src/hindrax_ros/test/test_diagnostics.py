"""The /diagnostics of one node: rejects are counted by what does not grow."""

from hindrax_core.events import Rejected, Stamp
from hindrax_core.rejects import RejectCode, reject
from hindrax_ros.diagnostics import NodeDiagnostics


def test_rejects_are_counted_by_their_keys_and_the_last_is_told_whole() -> None:
    health = NodeDiagnostics()
    for step in range(700, 800):
        health.reject(Rejected(Stamp(1), reject(RejectCode.LEAP, found=f"leap of {step} Pa")))
    health.reject(Rejected(Stamp(2), reject(RejectCode.CHECKSUM, "frame")))
    health.reject(Rejected(Stamp(3), "words of another package"))
    values = {one.key: one.value for one in health.report("hindrax: depth", Stamp(4), 1.0).values}
    assert {key: value for key, value in values.items() if "reject" in key} == {
        "rejects": "102",
        "last reject": "words of another package",
        "rejected: frame: checksum": "1",
        "rejected: leap": "100",
        "rejected: words of another package": "1",
    }


def test_without_a_reject_there_is_none_to_tell() -> None:
    values = {one.key for one in NodeDiagnostics().report("hindrax: depth", Stamp(4), 1.0).values}
    assert "last reject" not in values


def test_a_device_that_answered_and_has_measured_nothing_yet_has_no_age() -> None:
    health = NodeDiagnostics(identity="MS5837 at 0x76")
    assert health.report("hindrax: depth", Stamp(4), 1.0).message == "no reading since it answered; line is silent"
    health.reading(Stamp(4))
    assert health.report("hindrax: depth", Stamp(3 * 10**9 + 4), 1.0).message.startswith("no reading for 3.0 s; ")


def test_a_line_on_which_all_is_rejected_is_not_called_silent_before_it_is() -> None:
    health = NodeDiagnostics(identity="Ping1D")
    health.reject(Rejected(Stamp(1), reject(RejectCode.CONFIDENCE, found="confidence 0 %")))
    told = health.report("hindrax: ping", Stamp(4), 1.0).message
    assert told == "no reading since it answered; all are rejected, the last: confidence 0 %"
    assert health.report("hindrax: ping", Stamp(5), 1.0).message.endswith("; line is silent")
