"""The operator's end of the ROS graph: arm, fly, watch, disarm; pool test, live view, web page."""
