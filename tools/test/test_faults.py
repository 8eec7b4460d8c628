"""The table of faults: what is judged, how it is put together, and the lies of devices that are found in flight."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.command_line import main
from hindrax_core.events import stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Pressure
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.devices.imu.imu_signal import ImuTruth
from hindrax_sim.devices.ping1d import PingTruth
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec, altered_truth, fault_injector
from hindrax_sim.hardware import TrueState
from hindrax_sim.world import World
from hindrax_tools.faults import process_faults, table
from hindrax_tools.faults.device_faults import ROWS, ModePilot, Watched, fly, reported, unsaid
from hindrax_tools.faults.fault_outcome import (
    DISARMED,
    HOLD,
    MANEUVER,
    MODES,
    MOMENTS,
    OPERATOR,
    FaultOutcome,
    Judge,
    is_wrong,
)

WELL = FaultOutcome("dvl75", "died", "hold", 1, 0.4, 0.0, 1.0, "no command for 5 s")
FLYING = TrueState(10.0, (0.1, 0.0, 2.0), (0.2, 0.0, 0.0), 0.8, 0, (3.0, 1.5), (1600.0, 1500.0))
BELIEVED = Navigation(FLYING.attitude_rad, (0.0,) * 3, FLYING.velocity_mps, 0.8, 1.0, (0.0, 0.0), dvl_locked=True)


def test_a_line_of_the_log_is_the_state_again_and_states_whether_it_thrusts_and_leans() -> None:
    assert TrueState.parse(FLYING.line()) == FLYING
    assert not FLYING.neutral
    assert replace(FLYING, pulses_us=(1501.5, 0.0)).neutral
    assert replace(FLYING, attitude_rad=(math.pi, 0.0, 0.0)).tilt_deg == pytest.approx(180.0)
    assert replace(FLYING, attitude_rad=(math.radians(30.0), 0.0, 2.0)).tilt_deg == pytest.approx(30.0)


def test_a_state_is_wrong_by_tilt_depth_or_a_velocity_that_it_claims_to_know() -> None:
    assert not is_wrong(BELIEVED, FLYING)
    assert is_wrong(replace(BELIEVED, attitude_rad=(0.4, 0.0, 2.0)), FLYING)
    assert is_wrong(replace(BELIEVED, depth_m=0.2), FLYING)
    assert not is_wrong(replace(BELIEVED, depth_m=math.nan), FLYING)
    fast = replace(BELIEVED, velocity_mps=(0.2, math.nan, -0.6))
    assert is_wrong(fast, FLYING)
    assert not is_wrong(replace(fast, dvl_locked=False), FLYING)


def test_what_is_told_nowhere_or_by_a_wrong_exit_code_is_a_violation() -> None:
    judge = Judge(FLYING)
    judge.observe(replace(NEUTRAL, now_s=FLYING.now_s + 1.0), None)
    dead = [FaultSpec("supply_dies", ("supply",), 15.0, 9999.0)]
    ended = Watched(judge, "tilt: too far", thrust=True, exit_code=1, told=("terminal", "report", "exit 1"))
    assert unsaid(ended, MANEUVER, []) == ()
    assert unsaid(replace(ended, told=("exit 1",)), MANEUVER, []) == ("the report does not say tilt: too far",)
    assert unsaid(replace(ended, exit_code=0), MANEUVER, []) == ("it ended with 0, though tilt: too far",)
    silent = Watched(judge, thrust=True)
    assert unsaid(silent, HOLD, []) == ("it ended, and nobody is told why",)
    assert unsaid(silent, DISARMED, []) == ()
    assert unsaid(Watched(Judge(FLYING)), HOLD, dead) == ()
    assert unsaid(silent, DISARMED, dead) == ("it flies on without power, and nobody is told",)


def test_the_report_of_a_maneuver_is_a_place_where_its_end_stands() -> None:
    pilot = ModePilot(MANEUVER, 1)
    assert not reported(pilot, "")
    assert reported(pilot, "dvl_lock: no bottom lock for 5 s, wanted less")
    pilot.left_out["T3"] = "T3 gives less thrust than it should"
    assert reported(pilot, "")


def judged(mode: str, *steps: tuple[float, TrueState, Navigation | None], within_s: float = math.inf) -> FaultOutcome:
    judge = Judge(FLYING)
    for seconds, true, assumed in steps:
        judge.observe(replace(true, now_s=FLYING.now_s + seconds), assumed)
    return judge.cell("imu", "died", mode, 1, "", within_s=within_s)


NEUTRAL = replace(FLYING, pulses_us=(1500.0, 0.0))
TILTED = replace(BELIEVED, attitude_rad=(0.5, 0.0, 2.0))


def test_neutral_counts_from_the_fault_for_good_and_thrust_to_the_end_is_flying_on() -> None:
    ended = judged(HOLD, (0.1, NEUTRAL, None), (0.3, FLYING, BELIEVED), (1.0, NEUTRAL, None))
    assert ended.neutral_s == pytest.approx(0.3)
    assert judged(HOLD, (1.0, NEUTRAL, None), (3.0, FLYING, BELIEVED)).neutral_s is None
    assert judged(DISARMED, (1.0, NEUTRAL, None)).neutral_s == 0.0


VIOLATIONS = {
    "on a state that is wrong": judged(OPERATOR, (0.1, FLYING, TILTED), (0.6, FLYING, TILTED), (0.7, FLYING, TILTED)),
    "while disarmed": judged(DISARMED, (0.1, FLYING, BELIEVED), (1.0, NEUTRAL, BELIEVED)),
    "wanted 0.5 s": judged(OPERATOR, (0.6, FLYING, BELIEVED), (1.0, NEUTRAL, BELIEVED), within_s=0.5),
    "tilted by 57 deg": judged(OPERATOR, (0.1, replace(NEUTRAL, attitude_rad=(1.0, 0.0, 0.0)), None)),
    "wall": judged(MANEUVER, (0.1, replace(NEUTRAL, wall_hits=1), None)),
}


@pytest.mark.parametrize("why", VIOLATIONS)
def test_what_must_never_be_is_named(why: str) -> None:
    (sentence,) = VIOLATIONS[why].violated
    assert why in sentence


def test_short_thrust_on_a_wrong_state_neutral_on_one_and_a_wall_by_hand_are_no_violations() -> None:
    brief = ((0.1, FLYING, TILTED), (0.5, FLYING, TILTED), (0.6, FLYING, BELIEVED), (0.9, FLYING, TILTED))
    assert judged(OPERATOR, *brief, (1.5, replace(NEUTRAL, wall_hits=1), TILTED)).violated == ()


def test_the_time_to_find_out_begins_anew_with_every_fault_and_a_built_one_has_no_end() -> None:
    judge = Judge(FLYING)
    for seconds, again in ((0.1, False), (0.4, True), (0.8, False)):
        judge.observe(replace(FLYING, now_s=FLYING.now_s + seconds), TILTED)
        if again:
            judge.broken()
    assert judge.cell("imu", "", HOLD, 1, "").violated == ()
    judge.observe(replace(FLYING, now_s=FLYING.now_s + 1.0), TILTED)
    assert judge.cell("imu", "", HOLD, 1, "").violated == ("thrust for 0.60 s on a state that is wrong",)
    assert judge.cell("imu", "", HOLD, 1, "", longest_wrong_s=math.inf).violated == ()


def test_a_row_shows_the_worst_of_all_seeds() -> None:
    cells = [WELL, replace(WELL, seed=2, neutral_s=0.6), replace(WELL, mode=OPERATOR, neutral_s=None)]
    cells += [replace(WELL, mode=DISARMED, neutral_s=0.0, reason="not armed"), replace(WELL, mode="maneuver")]
    cells.append(replace(WELL, seed=2, mode="maneuver", neutral_s=None, told=("terminal", "exit 1")))
    (row,) = table.rows(cells, MODES)
    reported_text = "no command for 5 s"
    assert table.entry([]) == ""
    shown = ("0.40 s or flies on", "0.60 s", "flies on", "neutral")
    assert row == ("dvl75", "died", *shown, reported_text, "terminal, exit 1")
    assert table.entry([replace(WELL, neutral_s=None, wall=True)]) == "flies on (wall)"
    assert list(table.rows(cells, MOMENTS)) == []
    (bad,) = table.rows([*cells, replace(WELL, seed=3, violated=("ran into a wall",))], MODES)
    assert bad[3] == "VIOLATED"


def test_progress_counts_cells_of_which_one_stack_serves_many(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [one for one in process_faults.ROWS if one.who == "recorder"]

    def fly_stack(some: Sequence[process_faults.ProcessFault], seed: int) -> Iterator[FaultOutcome]:
        return (replace(WELL, what=row.what, mode=mode, seed=seed) for mode in MODES for row in some)

    monkeypatch.setattr(table.process_faults, "fly", fly_stack)
    cells = table.fly(("recorder",), (1, 2), workers=1)
    assert len(cells) == 2 * len(rows) * len(MODES)
    counts = [line for line in capsys.readouterr().err.splitlines() if line.endswith("cells")]
    assert counts[-1] == f"{len(cells)} of {len(cells)} cells"
    assert len(set(counts)) == len(counts)


@pytest.mark.parametrize("violated", [(), ("ran into a wall",)])
def test_the_command_ends_with_1_when_a_cell_is_violated(
    violated: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(table, "fly", lambda *_: [replace(WELL, mode=mode, violated=violated) for mode in MODES])
    assert main(["faults", "--only", "dvl75", "--json"]) == len(violated)
    document = json.loads(capsys.readouterr().out)
    assert len(document["violated"]) == len(violated) * len(MODES)
    assert document["cells"][1]["mode"] == HOLD
    assert main(["faults", "--only", "dvl75"]) == len(violated)
    assert ("VIOLATED" in capsys.readouterr().out) == bool(violated)


@pytest.mark.parametrize(
    ("who", "fault", "mode", "guard"),
    [
        ("icm20948", "gyro_offset", HOLD, "velocity"),
        ("dvl75", "velocity_turned", OPERATOR, "velocity"),
        ("dvl75", "velocity_scaled", MANEUVER, "velocity"),
        ("icm20948", "repeated", OPERATOR, "frozen"),
        ("ms5837", "depth_stuck", OPERATOR, "drift"),
    ],
)
def test_a_lie_ends_thrust_before_it_does_harm(who: str, fault: str, mode: str, guard: str) -> None:
    (row,) = [one for one in ROWS if (one.who, one.fault, one.also) == (who, fault, None)]
    (cell,) = fly(row, mode, 3)
    assert cell.violated == ()
    assert cell.neutral_s is not None
    assert cell.reason.startswith(f"{guard}: ")


DVL = DvlTruth(velocity_mps=(0.3, 0.0, 0.1), travel_m=(1.0, 0.0, 0.0))
LIES = {
    "velocity_bias": (
        DVL,
        lambda reported: (reported.velocity_mps, reported.travel_m) == ((0.55, 0.0, 0.1), (1.0, 0.0, 0.0)),
    ),
    "velocity_turned": (DVL, lambda reported: reported.velocity_mps == (0.0, 0.3, 0.1)),
    "velocity_scaled": (DVL, lambda reported: reported.velocity_mps == pytest.approx((0.45, 0.0, 0.15))),
    "velocity_frozen": (DVL, lambda reported: reported.frozen),
    "false_lock": (DVL, lambda reported: (reported.velocity_mps, reported.altitude_m) == ((0.0, 0.0, 0.0), 0.3)),
    "gyro_offset": (ImuTruth(), lambda reported: reported.rate_radps == (math.radians(40.0), 0.0, 0.0)),
    "force_offset": (ImuTruth(), lambda reported: reported.specific_force_mps2[1] == 3.0),
    "depth_stuck": (Pressure(1.1e5, 20.0), lambda reported: reported.pressure_Pa == 1.1e5),
    "gyro_scaled": (
        ImuTruth(rate_radps=(0.2, 0.0, -0.4)),
        lambda reported: reported.rate_radps == pytest.approx((0.3, 0.0, -0.6)),
    ),
    "gyro_turned": (ImuTruth(rate_radps=(0.2, 0.1, -0.4)), lambda reported: reported.rate_radps == (-0.1, 0.2, -0.4)),
    "depth_scaled": (
        Pressure(111_325.0, 20.0),
        lambda reported: reported.pressure_Pa == pytest.approx(113_325.0),
    ),
    "range_scaled": (PingTruth(2.0), lambda reported: reported.distance_m == 3.0),
    "range_short": (PingTruth(2.0), lambda reported: reported.distance_m == 1.5),
}


@pytest.mark.parametrize("fault", LIES)
def test_a_lie_begins_and_ends_and_is_what_it_states(fault: str) -> None:
    truth, as_said = LIES[fault]
    lies = altered_truth(FAULTS[fault].devices()[0], [FaultSpec(fault, FAULTS[fault].devices(), 1.0, 1.0)])
    assert lies(truth, 0.9) is truth
    assert as_said(lies(truth, 1.0))
    assert lies(truth, 2.0) is truth
    assert altered_truth("thrusters", [FaultSpec(fault, FAULTS[fault].devices())])(truth, 12.0) is truth


def test_a_stuck_sensor_keeps_what_it_had_and_a_false_velocity_covers_ground() -> None:
    stuck, biased = (
        altered_truth(device, [FaultSpec(fault, (device,), 0.0)])
        for device, fault in (("ms5837", "depth_stuck"), ("dvl75", "velocity_bias"))
    )
    assert stuck(Pressure(1.1e5, 20.0), 1.0) == stuck(Pressure(1.2e5, 20.0), 2.0) == Pressure(1.1e5, 20.0)
    still, same = (
        altered_truth(device, [FaultSpec(fault, (device,), 0.0)])
        for device, fault in (("icm20948", "gyro_frozen"), ("ping1d", "range_frozen"))
    )
    turning = ImuTruth(rate_radps=(0.1, 0.0, 0.0), specific_force_mps2=(0.0, 0.0, -9.8))
    assert still(turning, 1.0) == still(replace(turning, rate_radps=(0.0, 0.3, 0.0)), 2.0) == turning
    assert same(PingTruth(2.0), 1.0) == same(PingTruth(1.0), 2.0) == PingTruth(2.0)
    stays = altered_truth("dvl75", [FaultSpec("velocity_stuck", ("dvl75",), 0.0)])
    stays(DVL, 1.0)
    lied = stays(replace(DVL, velocity_mps=(-0.2, 0.1, 0.0)), 3.0)
    assert (lied.velocity_mps, lied.frozen) == (DVL.velocity_mps, False)
    assert lied.travel_m == pytest.approx((1.6, 0.0, 0.2))
    biased(DVL, 1.0)
    assert biased(replace(DVL, velocity_mps=(0.0, 0.0, 0.1)), 3.0).travel_m == pytest.approx((1.5, 0.0, 0.2))


def test_a_pressure_drifts_while_its_fault_lasts() -> None:
    vehicle = load_vehicle(default_vehicle())
    world = World(vehicle)
    inject = fault_injector(world, [FaultSpec("depth_drifts", ("ms5837",), 1.0, 5.0)])
    at = world.mounting(vehicle.sensors["ms5837"])
    per_m = vehicle.water.density_kgpm3 * GRAVITY_mps2
    found = []
    for now_s in (0.5, 1.0, 4.0, 7.0):
        world.stamp = stamp_from_s(now_s)
        inject(now_s)
        found.append((world.pressure_Pa(at) - vehicle.water.surface_pressure_Pa) / per_m)
    assert found == pytest.approx([found[0], found[0], found[0] + 0.03, found[0]])
