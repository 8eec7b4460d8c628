"""Records of any origin: bags of this stack, third-party bags, CSV."""
