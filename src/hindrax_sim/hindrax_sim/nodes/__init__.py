"""The ROS side of the mock: its clock on the graph, and what it truly does."""
