"""The ROS side of the drivers: the only place here that knows rclpy and messages."""
