"""The serial link of Robotino 3 and 4: tags over USB; and the frames of Robotino 1 and 2."""
