"""The network of the stack: the tether and whether its operator is alive, who may reach the graph, who is in it."""
