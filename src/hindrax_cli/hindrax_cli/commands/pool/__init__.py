"""The main job and what follows it."""
