"""The tool's own place in the ROS graph."""
