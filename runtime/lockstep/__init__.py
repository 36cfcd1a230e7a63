"""`lockstep` mode: the virtual-time scheduler with every service in a process of its own, stepped over Zenoh."""
