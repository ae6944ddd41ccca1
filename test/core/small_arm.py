"""The small arm has moved; the tests beside this file go with the plain forms."""

from test.support.small_arm import *  # noqa: F403
