"""A blind benchmark of identification: records of foreign plants, answers of any tool, one table."""
