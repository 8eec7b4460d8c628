"""A package of somebody else that brings a sensor: a water thermometer, TE TSYS01."""
