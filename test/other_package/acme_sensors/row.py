"""The row of the sensor, which the entry point names. It imports no driver: names alone load none."""

from hindrax_core.sensor_table import Sensor

TSYS01 = Sensor(
    "tsys01",
    "i2c",
    publishes={"temperature": 20},
    meaning="TE TSYS01, temperature of the water",
    measures=("temperature",),
    driver="acme_sensors.tsys01",
    emulator="acme_sensors.tsys01_emulator",
)
