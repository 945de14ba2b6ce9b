"""How the robot moves, compiled: kinematics, control laws, manoeuvres, and the model that they all read."""
