"""Virtual buses: register emulators behind addresses, served in process, over a socket, or as a file with ioctls."""
