"""Emulators of the devices, byte for byte as in their data sheets, with a settable truth; and their interfaces."""
