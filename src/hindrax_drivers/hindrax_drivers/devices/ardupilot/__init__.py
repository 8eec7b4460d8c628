"""The autopilot at the far end of a MAVLink link: what it says, and an ArduSub as the thruster output."""
