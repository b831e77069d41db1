"""The nodes: everything that knows ROS."""

from motor_sysid.threads import use_one

use_one()  # each node is a program, and its numpy is imported after this
