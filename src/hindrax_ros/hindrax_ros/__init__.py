"""What every node shares: messages, qualities, parameters, health, process loop."""
