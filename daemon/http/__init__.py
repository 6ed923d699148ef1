"""HTTP connections below the application: listen sockets, TLS handshakes, receive buffer, limits, problem details."""
