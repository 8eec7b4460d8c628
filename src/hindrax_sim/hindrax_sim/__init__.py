"""Mock hardware: six degree of freedom plant, device emulators, virtual buses, faults."""
