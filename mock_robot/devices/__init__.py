"""The camera, the scanner and EGM as servers on sockets."""
