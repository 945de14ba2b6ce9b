"""CB-RRT and S-RRT, compiled: extension, nearest neighbour and the growth of the tree."""
