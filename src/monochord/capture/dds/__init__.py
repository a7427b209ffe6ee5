"""ROS 2 messages over DDS, without ROS: ``messages`` has the types, ``participant`` sends and receives."""
