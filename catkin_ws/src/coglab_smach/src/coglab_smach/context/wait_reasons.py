"""Reasons for which the brain may wait: values of ``waits_code`` of coglab_msgs/MasterState."""

from coglab_msgs.msg import ReasonCode

ANSWER: int = ReasonCode.WAITS_FOR_ANSWER
ARM: int = ReasonCode.WAITS_FOR_ARM
HAND: int = ReasonCode.WAITS_FOR_HAND
SIGHT: int = ReasonCode.WAITS_FOR_SIGHT
PERSON: int = ReasonCode.WAITS_FOR_PERSON
CONTACT: int = ReasonCode.WAITS_FOR_CONTACT
OPERATOR: int = ReasonCode.WAITS_FOR_OPERATOR
