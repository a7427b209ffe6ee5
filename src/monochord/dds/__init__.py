"""ROS 2 messages over DDS, without ROS."""
