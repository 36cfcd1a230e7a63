"""Real cameras through OpenCV or HTTP: the service, what feeds it, and how a camera is calibrated."""
