"""What is to be solved, as plain data: the robot, its obstacles, its goal and the settings of the planners."""
