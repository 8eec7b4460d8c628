"""The ROS side of the identification."""
