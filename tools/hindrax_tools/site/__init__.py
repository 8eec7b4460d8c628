"""The site of the documentation: the pages as they are, with search, API pages and the notebook's outputs."""
