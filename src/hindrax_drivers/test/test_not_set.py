"""Not set is None: a value of the user that equals a default, or is 0, is the user's."""

import pytest

from hindrax_core.bus_operations import Write
from hindrax_core.errors import UsageError
from hindrax_core.hydrostatics import Water
from hindrax_drivers.devices.dvl75_settings import Dvl75Knobs, wanted_settings
from hindrax_drivers.devices.ina226 import Ina226, Ina226Knobs
from hindrax_drivers.devices.ping1d_settings import Ping1dKnobs, device_settings
from hindrax_drivers.devices.sos_leak import SosLeak, SosLeakKnobs

SEA = Water(density_kgpm3=1025.0, speed_of_sound_mps=1520.0)


@pytest.mark.parametrize(("set_mps", "used_mps"), [(None, 1520.0), (1484.0, 1484.0), (1484.5, 1484.5)])
def test_a_speed_of_sound_that_is_set_is_used_also_where_it_is_that_of_fresh_water(
    set_mps: float | None, used_mps: float
) -> None:
    assert wanted_settings(Dvl75Knobs(speed_of_sound_mps=set_mps), water=SEA)["Speed of sound"] == f"{used_mps:.1f}"
    first = device_settings(Ping1dKnobs(speed_of_sound_mps=set_mps), SEA)[0]
    assert int.from_bytes(first.payload, "little") == round(used_mps * 1000.0)


def test_a_leak_probe_may_be_at_line_0() -> None:
    for line, used in ((None, 27), (0, 0), (5, 5)):
        program = SosLeak(SosLeakKnobs(), line).configure()
        first = next(program)
        assert isinstance(first, Write)
        assert first.address == used


def test_an_address_is_the_usual_one_only_where_none_is_named() -> None:
    assert Ina226(Ina226Knobs()).address == Ina226(Ina226Knobs(), 0x41).address == 0x41
    with pytest.raises(UsageError, match="address: found 0x00, wanted 0x08 to 0x77; without it: 0x41"):
        Ina226(Ina226Knobs(), 0)
