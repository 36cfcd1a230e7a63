"""The motion controllers (Sec. 5.1, 5.2, 6.3.3): the robot's velocity from the push-line."""
