"""ROS 2 messages over DDS, without ROS: ``messages`` are what is said, ``participant`` is who says it."""
