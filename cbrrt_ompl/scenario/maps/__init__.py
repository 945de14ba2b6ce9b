"""Maps of others, read and written: ROS map_server, images, MovingAI, lists of discs."""
