"""The ROS side of the bags."""
