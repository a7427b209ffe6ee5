"""A Monochord sensor as a node of ROS 2."""
