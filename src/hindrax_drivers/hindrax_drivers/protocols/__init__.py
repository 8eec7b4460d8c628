"""What travels on serial lines: framing, checksums, fields and silence. Pure; the devices use them."""
