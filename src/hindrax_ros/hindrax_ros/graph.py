"""Publishers and subscriptions from the topics table, so that no node spells a topic or a quality; ends of goals."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from rclpy.action.server import ServerGoalHandle
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from hindrax_core.topics import Quality, Topic
from hindrax_ros.batched_node import BatchedNode, DeferredPublisher
from hindrax_ros.messages.serialization import message_class

UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""Name that the middleware gives to a publisher whose node is not discovered (yet, or after a stall)."""
QUEUE = 200
"""Messages that may wait for a reader that takes them when its turn comes."""
STREAM_Hz = 20.0
"""Usual rate from which on commands are read best effort: the next comes before a lost one is repaired, and a reliable
reader withholds all that follow until then. Readings and states are reliable: what is used is what is recorded."""


def profile(quality: Quality) -> QoSProfile:
    """Quality of service as an rclpy profile."""
    made = QoSProfile(
        depth=quality.depth,
        reliability=ReliabilityPolicy.RELIABLE if quality.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if quality.latched else DurabilityPolicy.VOLATILE,
    )
    if quality.deadline_s:
        made.deadline = Duration(seconds=quality.deadline_s)
    if quality.lifespan_s:
        made.lifespan = Duration(seconds=quality.lifespan_s)
    return made


def publisher(node: Node, topic: Topic, *, held: bool = True) -> Publisher | DeferredPublisher:
    """Make the publisher of one row of the topics table (a plain one: safety does not wait for a lifecycle).

    Parameters
    ----------
    node
        Of the publisher.
    topic
        Row of the table: name, type, quality of service.
    held
        Whether that of a batched node sends only when its publish queue is flushed.

    Returns
    -------
    Publisher | DeferredPublisher
        Deferred for a batched node.
    """
    made = Node.create_publisher(node, message_class(topic.type), topic.name, profile(topic.quality))
    return DeferredPublisher(made, node.publish_queue) if held and isinstance(node, BatchedNode) else made


def subscription(
    node: Node, topic: Topic, callback: Callable[[Any], None], *, raw: bool = False, queue: int = QUEUE
) -> Subscription:
    """Subscribe to one row of the topics table.

    Where the topic is remapped, the publisher may be of another stack: many send best effort, of which a reliable
    reader gets nothing. So such a subscription is best effort, unless the topic is latched.

    Parameters
    ----------
    node
        Of the subscription.
    topic
        Row of the table.
    callback
        Gets each message.
    raw
        Whether it gets CDR bytes instead.
    queue
        Messages that wait for a node that takes them when its turn comes; a command never has company.

    Returns
    -------
    Subscription
        Of rclpy.
    """
    command = topic.quality.depth == 1
    quality = topic.quality if command else replace(topic.quality, depth=queue)
    remapped = node.resolve_topic_name(topic.name) != node.resolve_topic_name(topic.name, only_expand=True)
    if (command and topic.rate_Hz >= STREAM_Hz) or (remapped and not quality.latched):
        quality = replace(quality, reliable=False)
    return node.create_subscription(message_class(topic.type), topic.name, callback, profile(quality), raw=raw)


def publishers_of(node: Node, topic: Topic) -> dict[str, str]:
    """Full name of the node of each publisher of a topic by its GID, as far as the graph is known; empty: no name."""
    found = node.get_publishers_info_by_topic(topic.name)
    return {bytes(one.endpoint_gid).hex(): _full_name(one.node_namespace, one.node_name) for one in found}


def _full_name(namespace: str, name: str) -> str:
    return "" if name == UNKNOWN else f"{namespace.rstrip('/')}/{name}"


def optional_class(type_name: str) -> type | None:
    """Class of a message type written as `package/msg/Type`; None where its package is not installed."""
    try:
        return message_class(type_name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != type_name.partition("/")[0]:
            raise
        return None


def end_goal(handle: ServerGoalHandle, aborted: str) -> None:
    """Bring the handle of an action's goal into its last state; `aborted`: the reason, empty when it succeeded."""
    if not aborted:
        handle.succeed()
    elif handle.is_cancel_requested:
        handle.canceled()
    else:
        handle.abort()
