"""Output-error fit over a whole record: whitening, noise, delays, the Cramer-Rao bound."""
