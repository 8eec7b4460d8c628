"""Problems of this machine and this vehicle, with remedies."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Check:
    """Name of the check, what was found, and the remedy: empty where there is nothing to be done."""

    name: str
    found: str
    remedy: str = ""

    @property
    def ok(self) -> bool:
        """Whether it has passed."""
        return not self.remedy

    def document(self) -> dict[str, object]:
        """As it appears in JSON."""
        return {"name": self.name, "ok": self.ok, "found": self.found, "remedy": self.remedy}
