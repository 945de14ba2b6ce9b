"""Where the robot may be: exact planar distances in compiled code, FCL as the referee, motions between states."""
