"""Water and gravity: pressure to depth."""

from dataclasses import dataclass

from hindrax_core.knobs import knob

GRAVITY_mps2 = 9.80665


@dataclass(frozen=True, slots=True)
class Water:
    """The water the vehicle is in."""

    density_kgpm3: float = knob(1000.0, 950.0, 1100.0, "density [kg/m^3]")
    kinematic_viscosity_m2ps: float = knob(1.01e-6, 1e-7, 1e-5, "kinematic viscosity [m^2/s]")
    speed_of_sound_mps: float = knob(1484.0, 1300.0, 1700.0, "speed of sound [m/s]")
    surface_pressure_Pa: float = knob(101325.0, 80000.0, 120000.0, "air pressure at the surface [Pa]")

    def depth_m(self, pressure_Pa: float) -> float:
        """Depth of a sensor that measures an absolute pressure; negative above the surface."""
        return (pressure_Pa - self.surface_pressure_Pa) / (self.density_kgpm3 * GRAVITY_mps2)
