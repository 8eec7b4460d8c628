"""Speed, each figure beside a peer measured in the same run: every module offers `rows() -> list[dict]`."""
