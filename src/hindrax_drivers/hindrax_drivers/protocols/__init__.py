"""Serial protocols: framing, checksums, fields and silence. Pure; the devices use them."""
