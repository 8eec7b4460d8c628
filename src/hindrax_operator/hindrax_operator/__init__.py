"""The operator's end of the ROS graph: arm, fly, monitor, disarm; pool test, live view, web page."""
