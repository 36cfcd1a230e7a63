"""The services of the pushing skill. Each folder holds a service and the pure modules it is made of."""
