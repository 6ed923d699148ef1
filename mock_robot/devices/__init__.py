"""Camera, scanner and EGM as servers on sockets."""
