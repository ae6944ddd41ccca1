"""The referee has moved; the tests beside this file go with the plain forms."""

from test.referees.law_referee import *  # noqa: F403
