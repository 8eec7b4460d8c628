"""Contents of messages without ROS: definitions, CDR bytes, and what the fields mean."""
