"""The simulated base and its world: SAPIEN's PhysX in the plane, our own friction, sensors, objects, scenes."""
