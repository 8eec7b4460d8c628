"""The ROS side of control."""
