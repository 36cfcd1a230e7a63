"""`live` mode: each service in its own process, free running over Zenoh, on one machine or several."""
