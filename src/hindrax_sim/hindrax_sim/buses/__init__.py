"""Virtual buses: register emulators at addresses, served in process, over a socket, or as a file with ioctls."""
