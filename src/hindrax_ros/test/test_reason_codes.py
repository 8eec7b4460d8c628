"""The codes of refusals in the interfaces are those of the core."""

from hindrax_core.text.refusals import Reason
from hindrax_msgs.msg import Reason as ReasonMessage


def test_the_constants_of_the_message_are_the_reasons() -> None:
    names = [
        name
        for name in dir(ReasonMessage)
        if name in Reason.__members__ or isinstance(getattr(ReasonMessage, name), int)
    ]
    assert {name: getattr(ReasonMessage, name) for name in names} == {one.name: one.value for one in Reason}
