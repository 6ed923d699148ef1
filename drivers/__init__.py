"""Device drivers; the only owner of sockets, serial ports and cameras."""
